"""Controls that act later than they are sent: both beside each other, for the referee."""

from dataclasses import replace

import casadi as ca
import numpy as np

from ocp.problem.cache import once_per_problem
from ocp.problem.constraint import Box
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Parameter
from ocp.solution.solution import Solution


def with_acting_controls(solution: Solution) -> Solution:
    """Return a solution whose controls are what is sent, and behind it what acts."""
    ocp = solution.problem
    if not ocp.delays:
        return solution
    values, columns = solution.data.values, [solution.u]
    for delay in ocp.delays:
        past, sent = values.named(delay.name), solution.u[:, delay.index(ocp.model)]
        assert past is not None
        columns.append(np.append(past, sent)[: len(sent), None])
    return solution.with_(problem=_acting(ocp), u=np.hstack(columns))


@once_per_problem
def _acting(ocp: OCP) -> OCP:
    """Return the problem without delays, in which what acts is a control of its own."""
    m, f, acting = ocp.model, ocp.model.f, list[ca.SX]()
    for delay in ocp.delays:
        acting.append(ca.SX.sym(f"{delay.control} that acts"))
        f = ca.substitute(f, delay.control, acting[-1])
    free = Box.unbounded(len(acting))
    past = {delay.name for delay in ocp.delays}
    more = tuple(Parameter(e.name, e.symbol, e.value) for e in ocp.given if e.name in past)
    model = replace(m, u=ca.vertcat(m.u, *acting), f=f, u_units=(), u_nominal=None)
    return replace(
        ocp,
        model=model,
        control_bounds=ocp.control_bounds & free,
        parameters=(*ocp.parameters, *more),
        delays=(),
        guess=None,
    )
