"""Constraints and costs on how fast the control changes, as a larger state."""

from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_instance, check_numbers
from ocp.checks.errors import ProblemError, UnsupportedProblem
from ocp.problem.constraint import Box, Constraint
from ocp.problem.model import Model
from ocp.problem.ocp import OCP


def with_input_rate(
    ocp: OCP, *, rate: Box, previous: ArrayLike = 0.0, weight: ArrayLike = 0.0
) -> OCP:
    r"""Return a discrete-time problem whose control is the change of the control.

    .. math:: z_k = (x_k, u_{k-1}), \quad u_k = u_{k-1} + \Delta u_k, \quad
              L + \Delta u_k' W \Delta u_k, \quad
              \underline{\Delta u} \le \Delta u_k \le \overline{\Delta u}

    No solver needs to know: bounds of the rate are bounds of a control, those of the control
    itself a path constraint, which also holds at the first step.

    Args:
        ocp: discrete in time.
        rate: bounds of the change per step, in units of u.
        previous: control applied before the start (m,); it is part of the new initial state.
        weight: W, weights of the squared changes (m,), none negative.

    Raises:
        UnsupportedProblem: for a continuous model, where the derivative of the control is meant.
        ProblemError: for a negative weight or a wrong size.
    """
    check_instance(ocp, OCP, "with_input_rate: the problem")
    check_instance(rate, Box, "with_input_rate: rate")
    m = ocp.model
    if not m.is_discrete:
        raise UnsupportedProblem(f"{ocp.name}: a change per step needs a discrete-time model")
    weights = check_numbers(weight, m.nu, f"{ocp.name}: weight of the rate")
    if (weights < 0.0).any():
        raise ProblemError(f"{ocp.name}: a negative weight of the rate: {weights}")
    before = ca.vertcat(*[ca.SX.sym(f"previous {name}") for name in m.u_names])
    change = ca.vertcat(*[ca.SX.sym(f"change of {name}") for name in m.u_names])
    now = before + change

    model = _model(m, before, change)

    def moved(expression: ca.SX | float) -> ca.SX:
        written = ca.vertcat(m.u, m.start)
        return ca.substitute(ca.SX(expression), written, ca.vertcat(now, model.start[: m.nx]))

    constraints = [part for c in ocp.constraints for part in _parts(ocp, c)]
    constraints = [replace(c, expression=moved(c.expression)) for c in constraints]
    if ocp.control_bounds.is_active:
        box = ocp.control_bounds
        bounds = Constraint("control_bounds", now, box.lower, box.upper, limits_input=True)
        constraints.append(bounds)
    free = Box.unbounded(m.nu)
    return replace(
        ocp,
        name=f"{ocp.name}, with input rate",
        model=replace(model, f=ca.vertcat(moved(m.f), now)),
        x0=np.append(np.asarray(ocp.x0), check_numbers(previous, m.nu, f"{ocp.name}: previous")),
        running_cost=moved(ocp.running_cost) + ca.dot(ca.DM(weights), change**2),
        control_bounds=rate,
        state_bounds=ocp.state_bounds & free,
        start_bounds=ocp.start_bounds & free,
        constraints=tuple(constraints),
        guess=None,
    )


def _parts(ocp: OCP, c: Constraint) -> list[Constraint]:
    """Return a constraint in parts that limit the input and that do not.

    What the control was is a state now, so that nothing tells them apart any more.
    """
    if c.at != "path":
        return [c]
    rows = [row for row in ocp.rows.path.rows if row.name == c.name]
    limits = np.array([row.kind == "input" for row in rows])
    if limits.all() or not limits.any():
        return [replace(c, limits_input=bool(limits.all()))]
    parts = []
    for which, name in ((~limits, c.name), (limits, f"{c.name}, input")):
        chosen = np.flatnonzero(which).tolist()
        box = np.asarray(c.lower)[chosen], np.asarray(c.upper)[chosen]
        nominal = None if c.nominal is None else np.asarray(c.nominal)[chosen]
        parts.append(
            Constraint(
                name,
                c.expression[chosen],
                *box,
                nominal=nominal,
                limits_input=name != c.name,
            )
        )
    return parts


def _model(m: Model, before: ca.SX, change: ca.SX) -> Model:
    """Return the model with the control before as a state, and its change as control."""
    now = before + change
    units = m.u_units or ("",) * m.nu
    return Model(
        name=f"{m.name} with input rate",
        x=ca.vertcat(m.x, before),
        u=change,
        f=ca.vertcat(ca.substitute(m.f, m.u, now), now),
        t=m.t,
        dt=m.dt,
        x_units=(*m.x_units, *units) if m.x_units else (),
        u_units=m.u_units,
        u_is_change=True,
    )
