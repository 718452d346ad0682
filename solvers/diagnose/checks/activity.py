"""What a solved trial shows: constraints that never act, controls that never move."""

from collections.abc import Iterator

import numpy as np

from ocp import OCP, Guess
from ocp.internal import sizes_of
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.subject import DiagnosedProblem

_SAME = 1e-5


def activity(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Check which bounds are active along the trial."""
    if not subject.trial.status.is_success:
        return
    yield from _idle(subject)
    yield from _saturated(subject)
    yield from _inactive(subject)


def _idle(subject: DiagnosedProblem) -> Iterator[Finding]:
    """An optimum where a control is constant: zero, or the bound next to it."""
    ocp, u, form = subject.written, subject.trial.u, subject.form
    if form is not None:
        u = form.own_controls(subject.trial.x[: len(u)], u)
    nothing = ocp.control_bounds.clip(np.zeros_like(u))
    if not u.size or ocp.has_free_time or ocp.data:  # data ask for constants, not for a motion
        return
    small = _SAME * (np.minimum(sizes_of(ocp).u, 1.0) + np.abs(u).max(axis=0))
    if (np.abs(u - nothing) > small).any():
        return
    if subject.ocp.at("terminal"):
        if ocp.has_free_start:
            yield _met_by_the_start(ocp)
        return
    better = _from_elsewhere(subject)
    if better < subject.trial.cost - _SAME * (1.0 + abs(subject.trial.cost)):
        yield _stationary_start(subject, better)
        return
    yield Finding(
        Cause.NO_GOAL,
        Severity.WARNING,
        ocp.model.u_names,
        "The optimum is to do nothing: every control stays at the number nearest to zero. Is a "
        "terminal constraint missing, does a reward lack its minus, or is the start the goal?",
        0.0,
    )


def _met_by_the_start(ocp: OCP) -> Finding:
    free = tuple(np.array(ocp.model.x_names)[ocp.start_is_free].tolist())
    return Finding(
        Cause.NO_GOAL,
        Severity.ADVICE,
        (*ocp.model.u_names, *free),
        f"The optimum is to start where nothing has to be done ({', '.join(free)} free at the "
        "start): every control stays at the number nearest to zero. Bound the start, or let the "
        "cost ask for a motion.",
        0.0,
    )


def _from_elsewhere(subject: DiagnosedProblem) -> float:
    """Return the lowest cost that is found from constant controls; inf where none is found."""
    ocp, data, costs = subject.ocp, subject.data, [np.inf]
    for side in (0.5, -0.5):
        start = Guess(u=ocp.control_bounds.clip(np.full(ocp.model.nu, side)))
        found = subject.program.run(
            x0=data.x0, t0=data.t0, parameters=data.values.as_dict(), guess=start
        )
        costs.append(found.cost if found.status.is_success else np.inf)
    return min(costs)


def _stationary_start(subject: DiagnosedProblem, better: float) -> Finding:
    return Finding(
        Cause.STATIONARY_GUESS,
        Severity.WARNING,
        subject.written.model.u_names,
        f"The solver ends where every control is the number nearest to zero, at the cost "
        f"{subject.trial.cost:.4g}; from other controls it finds {better:.4g}. Its start is "
        "stationary, but no minimum: give guess=Guess(u=...) that is not zero, or use multistart.",
        better,
    )


def _saturated(subject: DiagnosedProblem) -> Iterator[Finding]:
    ocp, u = subject.ocp, subject.trial.u
    lower, upper = np.asarray(ocp.control_bounds.lower), np.asarray(ocp.control_bounds.upper)
    for i, name in enumerate(ocp.model.u_names):
        if name in subject.terms.origins:
            continue  # a slack that is not needed
        for side, bounds in (("lower", lower), ("upper", upper)):
            # Relative to what the control may move by, which follows its unit.
            bound, width = float(bounds[i]), float(upper[i] - lower[i])
            near = _SAME * (width if 0.0 < width < np.inf else 1.0 + abs(bound))
            if np.isfinite(bound) and np.abs(u[:, i] - bound).max() <= near:
                unit = subject.unit(name)
                yield Finding(
                    Cause.SATURATED,
                    Severity.ADVICE,
                    (name,),
                    f"The control {name} is on its {side} bound {bound:g} {unit}".rstrip()
                    + " all the time: it is no decision. Is the bound, or the sign of its weight, "
                    "what was meant?",
                    bound,
                    unit,
                )


def _inactive(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Path constraints that stay further from their bounds than they ever move."""
    ocp = subject.ocp
    for c in subject.written.at("path"):
        values = subject.tried.evaluate(ocp, c.expression)
        inside = np.minimum(values - np.asarray(c.lower), np.asarray(c.upper) - values).min()
        moved = np.ptp(values, axis=0).max()
        if np.isfinite(inside) and inside > max(moved, _SAME * (1.0 + np.abs(values).max())):
            yield Finding(
                Cause.INACTIVE,
                Severity.ADVICE,
                (c.name,),
                f"The path constraint '{c.name}' never comes closer to its bounds than "
                f"{inside:.3g} and moves by {moved:.3g} only: it can be left out, or its numbers "
                "are not what was meant.",
                float(inside),
            )
