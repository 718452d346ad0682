"""Pontryagin's minimum principle of a problem, derived symbolically, once."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ocp.constraint import Constraint
from ocp.errors import UnsupportedProblem
from ocp.functions import stacked

if TYPE_CHECKING:
    from ocp.problem import OCP

# H_uu with a smaller reciprocal condition number does not determine the control.
_SINGULAR = 1e-10


@dataclass(frozen=True, eq=False)
class Optimality:
    r"""The necessary conditions, as Functions of (x, costate, ...).

    .. math::

        H = L + \lambda' f, \quad \dot x = H_\lambda', \quad \dot\lambda = -H_x', \quad
        u^* = \arg\min_u H

    Signs are those of the minimum principle: the costate is dJ*/dx (thesis 3.60; 3.28 has
    the other sign). Source: thesis (3.35) to (3.42), [Bryson & Ho 1975].

    Attributes:
        hamiltonian: (x, u, costate, t, p) -> H.
        control_gradient: (x, u, costate, t, p) -> H_u (nu,).
        control_curvature: (x, u, costate, t, p) -> H_uu (nu, nu).
        costate_rate: (x, u, costate, t, p) -> -H_x (nx,).
        control: (x, costate, t, p) -> the minimising control (nu,), within its bounds.
        flow: (z, t, p) -> dz/dt for z = (x, costate), with the minimising control.
        start: (x, costate, mu, p, t) -> what must vanish at t0 where the start is free:
            the initial constraints c, and costate + c_x' mu (the costate is then normal
            to the manifold, thesis 3.45).
        end: (x, costate, nu, t, p) -> what must vanish at the final time:
            costate - phi_x - psi_x' nu; the terminal constraints psi; and where the final
            time is free H + phi_t + nu' psi_t.
    """

    hamiltonian: ca.Function
    control_gradient: ca.Function
    control_curvature: ca.Function
    costate_rate: ca.Function
    control: ca.Function
    flow: ca.Function
    start: ca.Function
    end: ca.Function


@lru_cache(maxsize=32)
def derive(ocp: "OCP") -> Optimality:
    """Derive the minimum principle of a continuous-time problem.

    Raises:
        UnsupportedProblem: for a discrete-time model, a Hamiltonian that is linear in a
            control (bang-bang or singular arcs) or whose minimiser is not unique, and for
            terminal or initial inequalities.
    """
    if ocp.model.is_discrete:
        raise UnsupportedProblem(f"{ocp.name}: the minimum principle here is that of continuous time")
    m, p = ocp.model, ocp.p
    costate = ca.SX.sym("costate", m.nx)
    hamiltonian = ocp.running_cost + ca.dot(costate, m.f)
    gradient = ca.densify(ca.gradient(hamiltonian, m.u))
    curvature = ca.jacobian(gradient, m.u)
    rate = -ca.densify(ca.gradient(hamiltonian, m.x))
    variables = [m.x, m.u, costate, m.t, p]
    names = ["x", "u", "costate", "t", "p"]

    def along(name: str, expression: ca.SX) -> ca.Function:
        return ca.Function(name, variables, [expression], names, [name])

    curvature_function = along("control_curvature", ca.densify(curvature))
    gradient_function = along("control_gradient", gradient)
    _require_regular(ocp, hamiltonian, curvature, curvature_function)
    control = _minimising_control(ocp, costate, gradient, curvature, gradient_function)
    return Optimality(
        hamiltonian=along("hamiltonian", hamiltonian),
        control_gradient=gradient_function,
        control_curvature=curvature_function,
        costate_rate=along("costate_rate", rate),
        control=control,
        flow=_flow(ocp, control, along("costate_rate", rate)),
        start=_start(ocp, costate),
        end=_end(ocp, costate, control, along("hamiltonian", hamiltonian)),
    )


def _require_regular(
    ocp: "OCP", hamiltonian: ca.SX, curvature: ca.SX, curvature_function: ca.Function
) -> None:
    """Refuse a Hamiltonian that does not determine the control."""
    m = ocp.model
    for i, name in enumerate(m.u_names):
        if curvature[i, :].nnz() == 0:
            raise UnsupportedProblem(
                f"{ocp.name}: the Hamiltonian is linear in the control {name}: its minimum is "
                "bang-bang or singular; use a direct method"
            )
    p0 = ocp.parameter_values().at(0.0)[0]
    u0 = ocp.control_bounds.clip(np.zeros(m.nu))
    probes = [np.zeros(m.nx), *np.random.default_rng(0).normal(size=(3, m.nx))]
    hessians = [np.array(curvature_function(ocp.x0, u0, probe, 0.0, p0)) for probe in probes]
    if all(np.linalg.matrix_rank(h, tol=_SINGULAR * (1 + np.abs(h).max())) < m.nu for h in hessians):
        raise UnsupportedProblem(
            f"{ocp.name}: H_uu is singular, the Hamiltonian does not determine the control; "
            "add the cost of the directions without effect (for a redundant arm: the "
            "regularised running cost)"
        )


def _minimising_control(
    ocp: "OCP", costate: ca.SX, gradient: ca.SX, curvature: ca.SX, gradient_function: ca.Function
) -> ca.Function:
    """Closed form where H is quadratic in u, saturated at the bounds; else an implicit root."""
    m, p = ocp.model, ocp.p
    inputs, names = [m.x, costate, m.t, p], ["x", "costate", "t", "p"]
    box = ocp.control_bounds
    quadratic = not ca.depends_on(curvature, m.u)
    diagonal = curvature.sparsity().is_diag()
    if not quadratic or (box.is_active and not diagonal):
        return _implicit_control(ocp, gradient_function)
    at_zero = ca.substitute(gradient, m.u, ca.DM.zeros(m.nu))
    free = -at_zero / ca.diag(curvature) if diagonal else -ca.solve(curvature, at_zero)
    bounded = _clip(free, box.lower, box.upper) if box.is_active else free
    return ca.Function("control", inputs, [bounded], names, ["u"])


def _implicit_control(ocp: "OCP", gradient_function: ca.Function) -> ca.Function:
    """Root in u of the natural residual u - clip(u - H_u), by Newton from the nearest point to 0."""
    m = ocp.model
    u = ca.MX.sym("u", m.nu)
    inputs = [ca.MX.sym("x", m.nx), ca.MX.sym("costate", m.nx), ca.MX.sym("t"), ca.MX.sym("p", ocp.p.numel())]
    x, costate, t, p = inputs
    slope = gradient_function(x, u, costate, t, p)
    box = ocp.control_bounds
    residual = u - _clip(u - slope, box.lower, box.upper) if box.is_active else slope
    root = ca.rootfinder(
        "root", "newton", {"x": u, "p": ca.vertcat(x, costate, t, p), "g": residual},
        {"abstol": 1e-13, "abstolStep": 1e-13, "max_iter": 50, "error_on_fail": False},
    )
    guess = box.clip(np.zeros(m.nu))
    return ca.Function(
        "control", inputs, [root(guess, ca.vertcat(x, costate, t, p))], ["x", "costate", "t", "p"], ["u"]
    )


def _clip(value: ca.SX, lower: object, upper: object) -> ca.SX:
    return ca.fmin(ca.fmax(value, ca.DM(np.asarray(lower))), ca.DM(np.asarray(upper)))


def _flow(ocp: "OCP", control: ca.Function, costate_rate: ca.Function) -> ca.Function:
    m, n_p = ocp.model, ocp.p.numel()
    # An implicit control is a root finder, which exists only in MX graphs.
    kind = ca.SX if control.is_a("SXFunction") else ca.MX
    z, t, p = kind.sym("z", 2 * m.nx), kind.sym("t"), kind.sym("p", n_p)
    x, costate = z[: m.nx], z[m.nx :]
    u = control(x, costate, t, p)
    rate = ca.vertcat(ocp.functions.rate(x, u, t, p), costate_rate(x, u, costate, t, p))
    return ca.Function("flow", [z, t, p], [rate], ["z", "t", "p"], ["rate"])


def _start(ocp: "OCP", costate: ca.SX) -> ca.Function:
    m = ocp.model
    c = _equations(ocp, ocp.at("initial"))
    mu = ca.SX.sym("mu", c.numel())
    normal = costate + ca.mtimes(ca.jacobian(c, m.x).T, mu)
    return ca.Function(
        "start", [m.x, costate, mu, m.t, ocp.p], [ca.vertcat(c, normal)],
        ["x", "costate", "mu", "t", "p"], ["residual"],
    )


def _end(ocp: "OCP", costate: ca.SX, control: ca.Function, hamiltonian: ca.Function) -> ca.Function:
    m, p = ocp.model, ocp.p
    psi = _equations(ocp, ocp.at("terminal"))
    nu = ca.SX.sym("nu", psi.numel())
    bolza = ocp.terminal_cost + ca.dot(nu, psi)
    conditions = ca.Function(
        "conditions", [m.x, costate, nu, m.t, p],
        [ca.vertcat(costate - ca.gradient(bolza, m.x), psi), ca.gradient(bolza, m.t)],
    )
    sizes = {"x": m.nx, "costate": m.nx, "nu": nu.numel(), "t": 1, "p": p.numel()}
    kind = ca.SX if control.is_a("SXFunction") else ca.MX
    x, lam, nu, t, p = inputs = [kind.sym(name, size) for name, size in sizes.items()]
    residual, bolza_t = conditions(x, lam, nu, t, p)
    if ocp.has_free_time:
        residual = ca.vertcat(residual, hamiltonian(x, control(x, lam, t, p), lam, t, p) + bolza_t)
    return ca.Function("end", inputs, [residual], list(sizes), ["residual"])


def _equations(ocp: "OCP", constraints: tuple[Constraint, ...]) -> ca.SX:
    """Return what must vanish, or refuse an inequality."""
    for c in constraints:
        if not c.is_equation:
            raise UnsupportedProblem(
                f"{ocp.name}: the {c.at} constraint '{c.name}' is an inequality; the minimum "
                "principle here takes equations at the ends; use a direct method"
            )
    lowers = ca.vertcat(ca.DM(0, 1), *[ca.DM(np.asarray(c.lower)) for c in constraints])
    return stacked(constraints) - lowers
