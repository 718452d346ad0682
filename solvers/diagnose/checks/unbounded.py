"""A cost that falls without limit."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp import Status
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import appearing
from solvers.diagnose.subject import DiagnosedProblem

# A cost this far below that of the first iterate has no bottom.
_ABYSS = 1e6
# Sizes of the constant controls along which the cost is followed.
_RAY = (1e1, 1e2, 1e3, 1e4)


def unbounded(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Follow the cost along growing controls; look at how far a failed trial fell."""
    fall = _ray(subject)
    if fall is None and not subject.trial.status.is_success:
        costs = subject.trial.history.get("cost", np.array([]))
        costs = costs[np.isfinite(costs)]
        deep = costs.size and costs.min() < -_ABYSS * (1.0 + abs(costs[0]))
        told = subject.trial.status is Status.DIVERGED and "unbounded" in subject.trial.message
        if deep or told:
            fall = float(costs.min()) if costs.size else -np.inf
    if fall is None:
        return
    ocp, m = subject.ocp, subject.ocp.model
    names = appearing(ocp, ca.vertcat(ca.SX(ocp.running_cost), ca.SX(ocp.terminal_cost)))
    where = tuple(n for n in names if n in (*m.x_names, *m.u_names))
    yield Finding(
        Cause.UNBOUNDED,
        Severity.ERROR,
        where or m.u_names,
        f"The cost falls without limit (to {fall:.2g}, and further the larger the controls get): "
        f"look for an odd power, a product or a sign in the terms of {', '.join(where)}, or bound "
        "controls and states.",
        fall,
    )


def _ray(subject: DiagnosedProblem) -> float | None:
    """Return the cost far out on a ray of constant controls if it falls ever faster there.

    Only where nothing bounds controls, states or ends: such a control is then allowed.
    """
    ocp, m = subject.ocp, subject.ocp.model
    if ocp.constraints or ocp.state_bounds.is_active or ocp.has_free_time:
        return None
    lower, upper = (np.asarray(getattr(ocp.control_bounds, s)) for s in ("lower", "upper"))
    for i in range(m.nu):
        for sign, bound in ((1.0, upper[i]), (-1.0, lower[i])):
            if np.isfinite(bound):
                continue
            costs = np.array([_cost(subject, i, sign * size) for size in _RAY])
            if np.isfinite(costs).all() and costs[0] < 0 and (costs[1:] < 10 * costs[:-1]).all():
                return float(costs[-1])
    return None


def _cost(subject: DiagnosedProblem, i: int, size: float) -> float:
    ocp, data, intervals = subject.ocp, subject.data, subject.program.grid
    u = subject.along.u[:-1].copy()
    u[:, i] = size
    x, costs = intervals.rollout(data.x0, u.T, *intervals.schedule(data, ocp.duration))
    end = data.values.at(1.0)[0]
    last = ocp.functions.terminal_cost(np.array(x)[:, -1], data.t0 + ocp.duration, end)
    return float(np.sum(costs)) + float(last)
