"""Quantities and weights of very different size."""

from collections.abc import Iterator
from dataclasses import replace

import casadi as ca
import numpy as np

from ocp.internal import without_traces
from solvers.diagnose.cause import Cause
from solvers.diagnose.conditioning import Conditioning, conditioning
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import depends
from solvers.diagnose.subject import DiagnosedProblem

# Beyond these ratios an interior-point method loses its digits.
_SIZES, _WEIGHTS = 1e5, 1e10
# A Newton step with such a matrix has few digits left; scaling is to blame for that much of it.
_CONDITION, _GAIN = 1e13, 1e8


def scaling(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Compare sizes, what a typical step costs, and the KKT matrix before and after balancing."""
    found, known = list(_sizes_and_weights(subject)), conditioning(subject)
    if known is not None:
        said = [replace(f, sentence=f"{f.sentence} {known}") for f in found]
        found = said or list(_badly_conditioned(known))
    yield from found


def _badly_conditioned(known: Conditioning) -> Iterator[Finding]:
    """What sizes and weights did not show, such as dynamics with very different coefficients."""
    if known.raw > _CONDITION and known.gain > _GAIN:
        yield Finding(
            Cause.BAD_SCALING,
            Severity.WARNING,
            tuple(dict.fromkeys((known.large, known.small))),
            f"{known} Choose units, or weights, in which a typical {known.large} and a typical "
            f"{known.small} move cost and constraints equally.",
            known.raw,
        )


def _sizes_and_weights(subject: DiagnosedProblem) -> Iterator[Finding]:
    m = subject.ocp.model
    names, sizes = (*m.x_names, *m.u_names), _sizes(subject)
    large, small = int(sizes.argmax()), int(sizes.argmin())
    if sizes[large] > _SIZES * sizes[small]:
        yield Finding(
            Cause.BAD_SCALING,
            Severity.WARNING,
            (names[large], names[small]),
            f"{_sized(subject, names[large], sizes[large])} beside "
            f"{_sized(subject, names[small], sizes[small])}: choose units in which all are near "
            f"1, that is divide {_divisors(names, sizes)}.",
            float(sizes[large] / sizes[small]),
        )
    yield from _weights(subject, names, sizes)


def _sized(subject: DiagnosedProblem, name: str, size: float) -> str:
    return f"{name} is of size {size:.2g} {subject.unit(name)}".rstrip()


def _divisors(names: tuple[str, ...], sizes: np.ndarray) -> str:
    """Return what to divide by what; what is of size 1 stays as it is."""
    powers = [(name, _power(size)) for name, size in zip(names, sizes, strict=True)]
    said = [f"{name} by {power:.0e}" for name, power in powers if power != 1.0]
    return " and ".join([", ".join(said[:-1]), said[-1]]) if len(said) > 1 else said[0]


def _power(size: float) -> float:
    return 10.0 ** np.round(np.log10(size))


def _sizes(subject: DiagnosedProblem) -> np.ndarray:
    """Return how large each state and control is: by its numbers, and along a solved trial.

    A roll-out that nobody wanted says nothing about sizes. What is small along the trial only may
    grow; it counts as 1. What is bounded tightly on both sides is small.
    """
    ocp, m = subject.ocp, subject.ocp.model
    boxes = [np.concatenate([getattr(b, s) for b in (ocp.state_bounds, ocp.control_bounds)])
             for s in ("lower", "upper")]  # fmt: skip
    start = np.concatenate([subject.data.x0, np.zeros(m.nu)])
    rows = np.abs(np.vstack([*boxes, start]))
    declared = np.where(np.isfinite(rows), rows, 0.0).max(axis=0)
    seen = declared
    if subject.trial.status.is_success:
        tried = np.abs(np.hstack([subject.tried.x, subject.tried.u])).max(axis=0)
        seen = np.maximum(declared, tried)
    bounded = np.isfinite(boxes[0]) & np.isfinite(boxes[1]) & (declared > 0.0)
    return np.where(bounded, seen, np.maximum(seen, 1.0))


def _weights(
    subject: DiagnosedProblem, names: tuple[str, ...], sizes: np.ndarray
) -> Iterator[Finding]:
    ocp, m = subject.ocp, subject.ocp.model
    z = ca.vertcat(m.x, m.u)
    gradient = ca.gradient(ca.SX(ocp.running_cost), z)
    diagonal = ca.vertcat(*[ca.jacobian(gradient[i], z[i]) for i in range(z.numel())])
    points = subject.tried if subject.trial.status.is_success else subject.along
    values = without_traces(points.evaluate(ocp, diagonal))
    values = np.abs(values[np.isfinite(values).all(axis=1)]).max(axis=0, initial=0.0) * sizes**2
    there = np.flatnonzero(values > 0.0)
    if not there.size:
        return
    large, small = there[values[there].argmax()], there[values[there].argmin()]
    if values[large] > _WEIGHTS * values[small]:
        priced = _priced(subject, int(large))
        by = f", by the price of {', '.join(repr(name) for name in priced)}" if priced else ""
        advice = "make it hard" if priced else "make the dear one a constraint"
        yield Finding(
            Cause.BAD_SCALING,
            Severity.WARNING,
            (*priced, names[large], names[small]),
            f"A typical {names[large]} costs {values[large] / values[small]:.1e} times what a "
            f"typical {names[small]} costs{by}: the smaller is lost in rounding. Bring the weights "
            f"closer, or {advice}.",
            float(values[large] / values[small]),
        )


def _priced(subject: DiagnosedProblem, which: int) -> tuple[str, ...]:
    """Return the soft constraints whose quadratic price makes a state or control dear."""
    m = subject.ocp.model
    symbol = ca.vertcat(m.x, m.u)[which]
    return tuple(
        c.name
        for c in subject.written.at("path")
        if c.soft is not None
        and np.any(np.asarray(c.soft.quadratic) > 0.0)
        and depends(c.expression, symbol)
    )
