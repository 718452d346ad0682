"""The control that minimises the Hamiltonian, in closed form or as an implicit root."""

from typing import Any

import casadi as ca
import numpy as np

from ocp.minimum_principle.hamiltonian import Hamiltonian
from ocp.problem.ocp import OCP

_LAW_INPUTS = ["x", "costate", "t", "p"]
# Where the root of H_u is looked for: so many steps of descent lead into the valley of a minimum,
# each the best of these multiples of a Newton step whose curvature is made positive, and of one
# unit more or less of each control, without which none would leave a maximum or a saddle.
_DESCENTS = 8
_REACHES = (4.0, 1.0, 0.25, 1.0 / 16.0)
# What is added to that curvature, for where there is none.
_LEAST_CURVATURE = 1e-8


def minimising_control(ocp: OCP, h: Hamiltonian) -> ca.Function:
    """Return (x, costate, t, p) -> the control minimising H within its bounds, (nu,).

    Closed form where H is quadratic in u, saturated at the bounds; else an implicit root.
    """
    m, p, e = ocp.model, ocp.p, h.expressions
    box = ocp.control_bounds
    diagonal = e.curvature.sparsity().is_diag()
    if ca.depends_on(e.curvature, m.u) or (box.is_active and not diagonal):
        return _implicit_control(ocp, h)
    # In both: an expression may contain a control without depending on it.
    zero = ca.SX.zeros(m.nu)
    at_zero, curvature = ca.substitute([e.gradient, e.curvature], [m.u], [zero])
    free = -at_zero / ca.diag(curvature) if diagonal else -ca.solve(curvature, at_zero)
    bounded = box.clip_expression(free)
    return ca.Function("control", [m.x, e.costate, m.t, p], [bounded], _LAW_INPUTS, ["u"])


def _implicit_control(ocp: OCP, h: Hamiltonian) -> ca.Function:
    """Root in u of the natural residual u - clip(u - H_u), by Newton from where descent led."""
    m, box = ocp.model, ocp.control_bounds
    u = ca.MX.sym("u", m.nu)
    sizes = (m.nx, m.nx, 1, ocp.p.numel())
    inputs = [ca.MX.sym(name, size) for name, size in zip(_LAW_INPUTS, sizes, strict=True)]
    x, costate, t, p = inputs
    slope = h.control_gradient(x, u, costate, t, p)
    residual = u - box.clip_expression(u - slope) if box.is_active else slope
    options = {"abstol": 1e-13, "abstolStep": 1e-13, "max_iter": 50}
    options |= {"error_on_fail": False, "show_eval_warnings": False}
    # The default, "qr", has no answer for a matrix with an entry of 1e-157: its square is none.
    options |= {"linear_solver": "symbolicqr"}
    given = ca.vertcat(*inputs)
    root = ca.rootfinder("root", "newton", {"x": u, "p": given, "g": residual}, options)
    start: Any = box.clip(np.zeros(m.nu))
    if ca.depends_on(h.expressions.curvature, m.u):  # else H is convex, and any start will do
        start = _constant(_descent(ocp, h).fold(_DESCENTS))(start, *inputs)
    found = root(start, given)
    bounded = box.clip_expression(found)  # the root is, up to rounding
    return ca.Function("control", inputs, [bounded], _LAW_INPUTS, ["u"])


def _descent(ocp: OCP, h: Hamiltonian) -> ca.Function:
    """(u, x, costate, t, p) -> u after one step down H, within its bounds.

    The curvature is H_uu, each row of it shifted where its Gershgorin disc reaches below zero:
    positive, the modulus of H_uu where there is one control, and H_uu itself near most minima.
    Next to an inflection of H it is at least abs(H_u), which keeps the step short.
    """
    m, box, e = ocp.model, ocp.control_bounds, h.expressions
    inputs = [m.x, e.costate, m.t, ocp.p]
    diagonal = ca.diag(e.curvature)
    lowest = diagonal - (ca.sum2(ca.fabs(e.curvature)) - ca.fabs(diagonal))
    shift = ca.fmax(-2.0 * lowest, 0.0) + ca.fabs(e.gradient) + _LEAST_CURVATURE
    newton = ca.solve(e.curvature + ca.diag(shift), e.gradient)
    moves = [-reach * newton for reach in _REACHES]
    moves += [sign * ca.DM(unit) for unit in np.eye(m.nu) for sign in (1.0, -1.0)]
    tried = [box.clip_expression(m.u + move) for move in moves]
    return ca.Function("descent", [m.u, *inputs], [_lowest(h, inputs, [m.u, *tried])])


def _constant(function: ca.Function) -> ca.Function:
    """Return a function without derivatives: a root does not depend on where it is looked for."""
    inputs = function.mx_in()
    options = {"is_diff_in": [False] * len(inputs), "is_diff_out": [False]}
    return ca.Function("start", inputs, function.call(inputs), options)


def _lowest(h: Hamiltonian, inputs: list[ca.SX], controls: list) -> ca.SX:
    """Return the control of lowest H, the first of them where several are."""
    x, costate, t, p = inputs
    best, least = controls[0], h.value(x, controls[0], costate, t, p)
    for u in controls[1:]:
        value = h.value(x, u, costate, t, p)
        best, least = ca.if_else(value < least, u, best), ca.fmin(value, least)
    return best
