r"""Rates of controls: the control is a state, and its rate is what the optimiser chooses.

.. math:: \dot u = r, \quad u(t_0) = u_{-1}, \quad \underline r \le r \le \overline r, \quad
          J + \int w \, r^2 \, dt

In discrete time the control stays, and what it was is a state:

.. math:: v_{k+1} = u_k, \quad v_0 = u_{-1}, \quad
          \underline r \le u_k - v_k \le \overline r, \quad J + \sum_k w \, (u_k - v_k)^2

The costate of that state at the start is the sensitivity to the last input.
"""

import casadi as ca
import numpy as np

from ocp.checks.expressions import element_names
from ocp.normal_form.draft import AddedControls, AddedStates, Draft
from ocp.normal_form.origin import Origin
from ocp.problem.constraint import Box, Constraint
from ocp.problem.ocp import OCP
from ocp.problem.scaled import sizes_of


def add_rates(draft: Draft) -> slice:
    """Add what the rates of controls need; return where the states stand that were the input."""
    ocp = draft.ocp
    if not ocp.rates:
        return slice(ocp.model.nx, ocp.model.nx)
    return _add_changes(draft) if ocp.model.is_discrete else _move(draft)


def _move(draft: Draft) -> slice:
    """Make controls states."""
    ocp, rates = draft.ocp, draft.ocp.control_rates
    index, r = rates.index.tolist(), ca.vertcat(*[ca.SX.sym(name) for name in rates.names])
    size = sizes_of(ocp).u[index]
    own = ocp.model.u[index]
    before = _before(ocp, own, r, bounds=ocp.control_bounds[index])
    at = draft.add_states(before, *_origins(own))
    draft.moved |= dict(zip(index, range(at.start, at.stop), strict=True))
    draft.add_controls(AddedControls(r, rates.box, size / ocp.duration))
    draft.running_cost += ca.dot(ca.DM(rates.weight), r**2)
    return at


def _add_changes(draft: Draft) -> slice:
    """Make what controls were states."""
    ocp, rates = draft.ocp, draft.ocp.control_rates
    u = ocp.model.u[rates.index.tolist()]
    last = ca.vertcat(*[ca.SX.sym(f"last {element}") for element in ca.vertsplit(u)])
    draft.running_cost += ca.dot(ca.DM(rates.weight), (u - last) ** 2)
    for i in np.flatnonzero(np.isfinite(rates.box.lower) | np.isfinite(rates.box.upper)).tolist():
        box, change = rates.box[[i]], u[i] - last[i]
        name = draft.unused(f"bound of {rates.names[i]}", Origin(rates.names[i], "rate"))
        draft.constraints.append(Constraint(name, change, box.lower, box.upper, limits_input=True))
    return draft.add_states(_before(ocp, last, u), *_origins(u))


def _origins(u: ca.SX) -> list[Origin]:
    return [Origin(name) for name in element_names(u)]


def _before(ocp: OCP, symbol: ca.SX, after: ca.SX, *, bounds: Box | None = None) -> AddedStates:
    """Return states that start at the last input, or where the optimiser likes."""
    index, is_free = ocp.control_rates.index.tolist(), ocp.last_input is None
    box = ocp.control_bounds[index]
    return AddedStates(
        symbol=symbol,
        rate=after,
        start=box.clip(np.zeros(len(index))) if is_free else np.asarray(ocp.last_input),
        is_free=is_free,
        box=box if is_free else Box.unbounded(len(index)),
        size=sizes_of(ocp).u[index],
        bounds=bounds,
    )
