"""The control along an extremal, for a problem as it is written.

Its minimum principle is that of the normal form: there it has states and costates of which the
problem itself knows nothing, such as the price of an integral.
"""

from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp.minimum_principle.necessary_conditions import minimum_principle, symbol_type
from ocp.normal_form.normal_form import normal_form
from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.solution.solution import Solution


class ExtremalLaw(NamedTuple):
    """What drives an extremal; z is state and costate in normal form, p that of the problem.

    Attributes:
        control: (z, t, p) -> the minimising control (nu,).
        flow: (z, t, p) -> dz/dt.
        price: (z, t, p) -> what the rates of the controls cost per second.
    """

    control: ca.Function
    flow: ca.Function
    price: ca.Function


@once_per_problem
def extremal_law(ocp: OCP) -> ExtremalLaw:
    """Derive it from the normal form."""
    form = normal_form(ocp)
    inner = ocp if form is None else form.problem
    conditions, nx = minimum_principle(inner), inner.model.nx
    kind = symbol_type(conditions.flow)
    z, t, p = kind.sym("z", 2 * nx), kind.sym("t"), kind.sym("p", ocp.p.numel())
    # Parameters come first, behind them what is a state there. What steps at instants is left out:
    # between them the flow is that of the costates behind the last one, see ``extremal_of``.
    count = sum(e.symbol.numel() for e in ocp.parameters)
    # Not p[:count], which of a scalar is a row without columns.
    given, _ = ca.vertsplit(p, [0, count, p.numel()])
    own = ca.vertcat(given, kind.zeros(inner.p.numel() - count))
    u, price = conditions.control(z[:nx], z[nx:], t, own), kind(0)
    if form is not None:
        if len(form.rates):  # of a scalar, no entries are a row without columns
            price = ca.dot(ca.DM(ocp.control_rates.weight), u[form.rates.tolist()] ** 2)
        u = ca.vertcat(z[:nx], u)[form.controls.tolist()]
    flow = conditions.flow(z, t, own)
    return ExtremalLaw(
        ca.Function("control", [z, t, p], [u], ["z", "t", "p"], ["u"]),
        ca.Function("flow", [z, t, p], [flow], ["z", "t", "p"], ["rate"]),
        ca.Function("price", [z, t, p], [price]),
    )


def extremal_of(solution: Solution) -> Solution:
    """Return the solution whose states and costates, behind instants, drive an extremal."""
    normal, form = solution.normal, normal_form(solution.problem)
    if normal is None or form is None:
        return solution
    if not form.has_jumps:
        return normal
    at = (normal.x, normal.costate, normal.t, normal.fractions, normal.data.values)
    own = form.costate(*at, side=1)
    return normal.with_(costate=np.hstack([own, normal.costate[:, own.shape[1] :]]))
