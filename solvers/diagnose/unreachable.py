"""Ends that no control can influence, by structure or by the rank of the linearisation."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp import Constraint
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import appearing
from solvers.diagnose.subject import Subject

# Of the largest singular value: below, a combination of ends does not move.
_RANK = 1e-7
# How far a combination of ends may miss its value, relative to 1 + abs(value).
_MISS = 1e-6
# How strongly an end takes part in a combination to be named.
_SHARE = 0.1


def unreachable(subject: Subject) -> Iterator[Finding]:
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


def _equations(subject: Subject) -> list[tuple[Constraint, ca.SX, float]]:
    return [
        (c, row, float(low))
        for c in subject.ocp.at("terminal")
        for row, low, high in zip(
            ca.vertsplit(c.expression), np.asarray(c.lower), np.asarray(c.upper), strict=True
        )
        if low == high
    ]


def _rollout(subject: Subject, rows: list, seed: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Return psi - target (m,) and its derivative in all controls and a free duration."""
    ocp, tr, m = subject.ocp, subject.program.transcription, subject.ocp.model
    rng, n = np.random.default_rng(seed), tr.n
    bounds = ocp.control_bounds
    low, high = (
        np.where(np.isfinite(b), b, d) for b, d in ((bounds.lower, -1.0), (bounds.upper, 1.0))
    )
    u = low + (high - low) * rng.uniform(size=(n, m.nu))
    duration = ocp.duration * (1.0 + seed * float(ocp.has_free_time))
    h = np.full((n, 1), duration / n)
    t = subject.data.t0 + np.arange(n)[:, None] * h
    left, right = subject.data.values.on(tr.fractions)
    x = [subject.data.x0]
    inputs = (t.T, h.T, left.T, right.T)
    after = np.array(subject.program.rollout(x[0], u.T, *inputs)[0])
    states = np.vstack([x[0], after.T])
    if not np.isfinite(states).all():
        return None
    step = subject.program.transcription.step
    slopes = step.factory(
        "slopes", step.name_in(), ["jac:x_next:x", "jac:x_next:u0", "jac:x_next:h"]
    ).map(n)
    a, b, by_h = (np.array(v) for v in slopes(states[:-1].T, u.T, *inputs))
    psi = ca.vertcat(*[row for _, row, _ in rows])
    p = subject.data.values.at(1.0)[0]
    last = ca.Function("psi", [m.x, m.t, ocp.p], [psi, ca.densify(ca.jacobian(psi, m.x))])
    value, psi_x = (np.array(v) for v in last(states[-1], t[-1] + h[-1], p))
    # Backwards: how the ends answer to the state after each step, hence to its control.
    answers, columns, timed = psi_x, [], np.zeros((len(rows), 1))
    for k in range(n - 1, -1, -1):
        columns.append(answers @ b[:, k * m.nu : (k + 1) * m.nu])
        timed += answers @ by_h[:, [k]]
        answers = answers @ a[:, k * m.nx : (k + 1) * m.nx]
    if ocp.has_free_time:
        columns.append(timed)
    if ocp.has_free_start:
        columns.append(answers)
    misses, answer = value.ravel() - [target for *_, target in rows], np.hstack(columns)
    finite = np.isfinite(misses).all() and np.isfinite(answer).all()
    return (misses, answer) if finite else None


def _kept(slopes: np.ndarray) -> np.ndarray:
    """Return the projector onto the combinations of rows that have no slope, (m, m)."""
    left, values, _ = np.linalg.svd(slopes, full_matrices=True)
    padded = np.append(values, np.zeros(len(slopes) - len(values)))
    null = left[:, padded <= _RANK * max(1.0, padded[0])]
    return null @ null.T


def _finding(subject: Subject, named: list, miss: float) -> Finding:
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
