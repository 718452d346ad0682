"""Unknown constants that nothing tells apart, such as two of which only the product acts."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from solvers.diagnose.cause import Cause
from solvers.diagnose.checks.influence import feeding
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import all_terms, depends
from solvers.diagnose.subject import DiagnosedProblem, SamplePoints

# Of the largest singular value, all columns of size 1: below, a direction changes nothing.
_RANK = 1e-8
# How strongly a constant takes part in such a direction to be named.
_SHARE = 0.1
# By how much constants differ from their guess where derivatives are taken.
_APART = 0.3


def identifiable(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Look for a direction of the constants in which no equation changes, or no measured value.

    At two different points: at one of them a derivative may vanish by chance.
    """
    if not subject.constants:
        return
    where = list(subject.constants)
    found = _null([_slopes_of_terms(subject, where, seed) for seed in (0, 1)])
    what = "equation"
    if found is None and subject.written.data:
        where = _left_to_data(subject)
        found = _null([_slopes_of_data(subject, where, seed) for seed in (0, 1)]) if where else None
        what = "measured value"
    if found is not None:
        yield _finding(subject, [where[i] for i in found], what)


def _null(slopes: list[np.ndarray]) -> list[int] | None:
    """Return the columns (k) that take part in a direction without slope in all; None: no such."""
    taking_part: set[int] = set()
    for each in slopes:
        each = each[np.isfinite(each).all(axis=1)]
        if not len(each):
            return None
        sizes = np.linalg.norm(each, axis=0)
        scaled = each / np.where(sizes > _RANK * sizes.max(initial=0.0), sizes, np.inf)
        _, values, right = np.linalg.svd(scaled, full_matrices=True)
        smallest = values[-1] if len(values) == each.shape[1] else 0.0
        if smallest > _RANK * max(values.max(initial=0.0), _RANK):
            return None
        taking_part |= set(np.flatnonzero(np.abs(right[-1]) > _SHARE).tolist())
    return sorted(taking_part)


def _shifted(subject: DiagnosedProblem, seed: int) -> np.ndarray:
    """Return a start (nx,) with other constants, within their bounds."""
    x0, rng = subject.data.x0.copy(), np.random.default_rng(seed)
    at, box = subject.constants, subject.ocp.start_box
    shift = _APART * rng.uniform(0.5, 1.0, len(at)) * (1.0 + np.abs(x0[at]))
    x0[at] = np.clip(x0[at] + shift, np.asarray(box.lower)[at], np.asarray(box.upper)[at])
    return x0


def _slopes_of_terms(subject: DiagnosedProblem, where: list[int], seed: int) -> np.ndarray:
    """Return the derivatives of all terms in the constants, at many points, (M, k)."""
    ocp, points = subject.ocp, subject.along + subject.around
    x = points.x.copy()
    x[:, where] = _shifted(subject, seed)[where]
    slope = ca.jacobian(all_terms(ocp), ocp.model.x[where])
    values = SamplePoints(x, points.u, points.t, points.p).evaluate(ocp, slope)
    return values.reshape(-1, len(where), slope.shape[0]).swapaxes(1, 2).reshape(-1, len(where))


def _left_to_data(subject: DiagnosedProblem) -> list[int]:
    """Return the constants that nothing but data determines: no other term feels them."""
    ocp, written = subject.ocp, subject.written
    own = written.model
    rows = [c.expression for c in (*written.constraints, *written.peaks)]
    others = ca.vertcat(ca.SX(written.running_cost), ca.SX(written.terminal_cost), *rows)
    box = written.state_bounds
    seen = np.array([depends(others, own.x[i]) for i in range(own.nx)], dtype=bool)
    seen |= np.isfinite(box.lower) | np.isfinite(box.upper)
    felt = ca.vertcat(others, own.f[np.flatnonzero(feeding(written, seen)).tolist()])
    return [i for i in subject.constants if not depends(felt, ocp.model.x[i])]


def _slopes_of_data(subject: DiagnosedProblem, where: list[int], seed: int) -> np.ndarray:
    """Return how measured values, in their sigmas, answer to the constants, (M, k)."""
    ocp, m, grid = subject.ocp, subject.ocp.model, subject.program.grid
    x0, u = _shifted(subject, seed), subject.excited(seed)
    inputs = grid.schedule(subject.data, ocp.duration)
    x = np.vstack([x0, np.array(grid.rollout(x0, u.T, *inputs)[0]).T])
    step, since = subject.program.transcription.step, subject.along.t - subject.data.t0
    by_x = step.factory("slopes", step.name_in(), ["jac:x_next:x"]).map(len(u))
    steps = np.array(by_x(x[:-1].T, u.T, *inputs))
    answers = [np.eye(m.nx)[:, where]]
    for k in range(len(u)):
        answers.append(steps[:, k * m.nx : (k + 1) * m.nx] @ answers[-1])
    points, rows = SamplePoints(x, np.vstack([u, u[-1:]]), subject.along.t, subject.along.p), []
    for measured in subject.written.data:
        slope = ca.jacobian(measured.expression, m.x)
        at = points.evaluate(ocp, slope).reshape(-1, m.nx, measured.size).swapaxes(1, 2)
        nodes = np.abs(since[:, None] - np.asarray(measured.times)).argmin(axis=0)
        for node, sigma, known in zip(
            nodes, np.asarray(measured.sigma), np.asarray(measured.values), strict=True
        ):
            rows.append(((at[node] @ answers[node]) / sigma[:, None])[~np.isnan(known)])
    return np.vstack(rows)


def _finding(subject: DiagnosedProblem, where: list[int], what: str) -> Finding:
    names = tuple(subject.ocp.model.x_names[i] for i in where)
    said = " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
    alone = len(names) == 1
    when = f"{said} changes" if alone else f"{said} change together, in one direction"
    left, one = ("it", "it") if alone else ("this direction", "one of them")
    more = "measure what it moves" if alone else "put one name in their place"
    return Finding(
        Cause.UNIDENTIFIABLE,
        Severity.WARNING,
        names,
        f"No {what} changes when {when}: the optimiser leaves {left} where the guess was. Fix "
        f"{one} as a number, {more}, or add a cost on what is known beforehand.",
        float(len(names)),
    )
