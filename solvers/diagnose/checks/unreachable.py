"""Ends that no control can influence, by structure or by the rank of the linearisation."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp import Constraint
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import appearing
from solvers.diagnose.subject import DiagnosedProblem

# Of the largest singular value: below, a combination of ends does not move.
_RANK = 1e-7
# How far a combination of ends may miss its value, relative to 1 + abs(value).
_MISS = 1e-6
# How strongly an end takes part in a combination to be named.
_SHARE = 0.1


def unreachable(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Roll out under two random controls; find combinations of ends that neither moves.

    A combination is called out of reach if, on both roll-outs, its derivative in every control
    is zero, it has the same value, and that value is not the one that is asked for.
    """
    rows = _equations(subject)
    if not rows:
        return
    rollouts = [_rollout(subject, rows, seed) for seed in (0, 1)]
    if any(r is None for r in rollouts):
        return
    (values, slopes), (other, other_slopes) = rollouts  # type: ignore[misc]
    both = np.hstack([slopes, other_slopes])
    size = np.abs(both).max(axis=1)
    size = np.where(size > _RANK * (1.0 + size.max()), size, 1.0)
    kept = _kept(both / size[:, None])
    miss, changed = kept @ (values / size), kept @ ((values - other) / size)
    tolerance = _MISS * (1.0 + float(np.abs(values / size).max()))
    if np.abs(miss).max() > tolerance and np.abs(changed).max() <= tolerance:
        share = np.abs(miss) / np.abs(miss).max()
        named = [rows[i] for i in np.flatnonzero(share > _SHARE)]
        yield _finding(subject, named, float(np.abs(miss * size).max()))


def _equations(subject: DiagnosedProblem) -> list[tuple[Constraint, ca.SX, float]]:
    return [
        (c, row, float(low))
        for c in subject.ocp.at("terminal")
        for row, low, high in zip(
            ca.vertsplit(c.expression), np.asarray(c.lower), np.asarray(c.upper), strict=True
        )
        if low == high
    ]


def _rollout(
    subject: DiagnosedProblem, rows: list, seed: int
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return psi - target (m,) under random controls, and its derivative in all that is free."""
    ocp = subject.ocp
    u = subject.excited(seed)
    # A free duration is doubled once, so that what only time moves is seen to move.
    duration = ocp.duration * (1.0 + seed * float(ocp.has_free_time))
    intervals = subject.program.grid
    inputs = intervals.schedule(subject.data, duration)
    after = np.array(intervals.rollout(subject.data.x0, u.T, *inputs)[0]).T
    states = np.vstack([subject.data.x0, after])
    if not np.isfinite(states).all():
        return None
    psi, psi_x = _end(subject, rows, states[-1], subject.data.t0 + duration)
    slopes = _backwards(subject, psi_x, states[:-1], u, inputs)
    misses = psi - [target for *_, target in rows]
    finite = np.isfinite(misses).all() and np.isfinite(slopes).all()
    return (misses, slopes) if finite else None


def _end(
    subject: DiagnosedProblem, rows: list, x: np.ndarray, t: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return psi (m,) and psi_x (m, nx) at the end."""
    ocp, m = subject.ocp, subject.ocp.model
    psi = ca.vertcat(*[row for _, row, _ in rows])
    outputs = [ca.densify(psi), ca.densify(ca.jacobian(psi, m.x))]
    last = ca.Function("psi", [m.x, m.t, ocp.p], outputs)
    value, slope = last(x, t, subject.data.values.at(1.0)[0])
    return np.array(value).ravel(), np.array(slope)


def _backwards(
    subject: DiagnosedProblem, psi_x: np.ndarray, x: np.ndarray, u: np.ndarray, inputs: list
) -> np.ndarray:
    """Return how the ends answer to every control, and to a free duration and start, (m, ...)."""
    ocp, m, step = subject.ocp, subject.ocp.model, subject.program.transcription.step
    starts = subject.start_directions
    names = ["jac:x_next:x", "jac:x_next:u0", "jac:x_next:h"]
    slopes = step.factory("slopes", step.name_in(), names).map(len(u))
    by_x, by_u, by_h = (np.array(v) for v in slopes(x.T, u.T, *inputs))
    answers, columns, timed = psi_x, [], np.zeros((len(psi_x), 1))
    for k in range(len(u) - 1, -1, -1):
        columns.append(answers @ by_u[:, k * m.nu : (k + 1) * m.nu])
        timed = timed + answers @ by_h[:, [k]]
        answers = answers @ by_x[:, k * m.nx : (k + 1) * m.nx]
    columns += [timed] * ocp.has_free_time + [answers @ starts]
    return np.hstack(columns)


def _kept(slopes: np.ndarray) -> np.ndarray:
    """Return the projector onto the combinations of rows that have no slope, (m, m)."""
    left, values, _ = np.linalg.svd(slopes, full_matrices=True)
    padded = np.append(values, np.zeros(len(slopes) - len(values)))
    null = left[:, padded <= _RANK * max(1.0, padded[0])]
    return null @ null.T


def _finding(subject: DiagnosedProblem, named: list, miss: float) -> Finding:
    states = [name for _, row, _ in named for name in appearing(subject.ocp, row)]
    names = tuple(dict.fromkeys([c.name for c, *_ in named] + states))
    alone = len(named) == 1
    unit = subject.unit(states[0]) if alone and named[0][1].is_symbolic() else ""
    what = (
        f"'{named[0][0].name}'"
        if alone
        else "a combination of " + ", ".join(dict.fromkeys(f"'{c.name}'" for c, *_ in named))
    )
    return Finding(
        Cause.UNREACHABLE,
        Severity.ERROR,
        names,
        f"No control moves {what} ({', '.join(dict.fromkeys(states))}): whatever is done, it ends "
        f"{miss:.3g} {unit}".rstrip()
        + " away from what is asked. Is a term missing in the "
        "dynamics, or does the model keep this quantity? Drop the constraint, or add an actuator.",
        miss,
        unit,
        subject.data.t0 + subject.ocp.duration,
    )
