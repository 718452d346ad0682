"""A measured value that is far from all others: a wrong unit, a mark for what is missing."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from ocp import Measurement
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.subject import DiagnosedProblem

# Fewer values say nothing of what is usual.
_FEW = 5
# So many times the usual distance from the line through the neighbours, and so many sigmas.
_FAR = 100.0


def outlier(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Compare every measured value with the line through its neighbours."""
    for measured in subject.written.data:
        for row in range(measured.size):
            found = _furthest(measured, row)
            if found is not None:
                yield _finding(subject, measured, row, found)


def _furthest(measured: Measurement, row: int) -> int | None:
    """Return which value of a row lies far from all others; None: none does.

    A step, whose neighbours disagree as much, is none; nor is the end of a steep decay, where the
    line through the next two is about as far from the one after the end.
    """
    known = np.flatnonzero(np.isfinite(np.asarray(measured.values)[:, row]))
    if len(known) < _FEW:
        return None
    t, y = np.asarray(measured.times)[known], np.asarray(measured.values)[known, row]
    sigma = np.asarray(measured.sigma)[known, row]
    before = np.clip(np.arange(len(y)) - 1, 0, None)
    after = np.clip(np.arange(len(y)) + 1, None, len(y) - 1)
    before[0], after[-1] = 2, len(y) - 3
    distance = _from_line(t, y, np.arange(len(y)), before, after)
    worst = int(distance.argmax())
    usual = max(float(np.median(distance)), float(sigma[worst]))
    if worst in (0, len(y) - 1):
        next_to_it = np.array([1, 2, 3]) if worst == 0 else len(y) - np.array([2, 3, 4])
        usual = max(usual, float(_from_line(t, y, *next_to_it)))
    apart = abs(y[after[worst]] - y[before[worst]])
    return int(known[worst]) if distance[worst] > max(_FAR * usual, apart) else None


def _from_line(
    t: np.ndarray, y: np.ndarray, at: ArrayLike, one: ArrayLike, other: ArrayLike
) -> np.ndarray:
    """Return how far values are from the line through two others."""
    k, i, j = (np.asarray(index) for index in (at, one, other))
    slope = (y[j] - y[i]) / (t[j] - t[i])
    return np.abs(y[k] - y[i] - slope * (t[k] - t[i]))


def _finding(subject: DiagnosedProblem, measured: Measurement, row: int, k: int) -> Finding:
    value, t = float(np.asarray(measured.values)[k, row]), float(np.asarray(measured.times)[k])
    of = f"row {row} of '{measured.name}'" if measured.size > 1 else f"'{measured.name}'"
    return Finding(
        Cause.OUTLIER,
        Severity.WARNING,
        (measured.name,),
        f"The measurement {of} has the value {value:g} at {t:g} s, far from the line through its "
        "neighbours, and least squares follow it. Another unit, or a mark for what is missing? "
        "Write numpy.nan for a value that there is not.",
        value,
        instant=subject.data.t0 + t,
    )
