"""The Hamiltonian of a problem and its derivatives."""

from dataclasses import dataclass

import casadi as ca

from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP


@dataclass(frozen=True, eq=False)
class HamiltonianExpressions:
    """The symbols behind the Functions: costate, H_u (nu,) and H_uu (nu, nu)."""

    costate: ca.SX
    gradient: ca.SX
    curvature: ca.SX


@dataclass(frozen=True, eq=False)
class Hamiltonian:
    r"""H and its derivatives as Functions of (x, u, costate, t, p).

    .. math:: H = L + \lambda' f

    The sign is that of the minimum principle: the costate is the gradient of the optimal
    cost in the state (thesis 3.60; 3.28 has the other sign).

    Attributes:
        value: H.
        control_gradient: H_u (nu,).
        control_curvature: H_uu (nu, nu).
        costate_rate: -H_x (nx,).
        time_slope: H_t, by the time that is written in f and L.
        expressions: the symbolic H_u and H_uu.
    """

    value: ca.Function
    control_gradient: ca.Function
    control_curvature: ca.Function
    costate_rate: ca.Function
    time_slope: ca.Function
    expressions: HamiltonianExpressions


@once_per_problem
def hamiltonian(ocp: OCP) -> Hamiltonian:
    r"""Derive :math:`H = L + \lambda' f` and its derivatives, once for each problem.

    Args:
        ocp: the problem, parameters included; in discrete time f is the next state, and L the
            cost of a step.
    """
    m = ocp.model
    costate = ca.SX.sym("costate", m.nx)
    value = ocp.running_cost + ca.dot(costate, m.f)
    gradient = ca.densify(ca.gradient(value, m.u))
    curvature = ca.jacobian(gradient, m.u)
    inputs, names = [m.x, m.u, costate, m.t, ocp.p], ["x", "u", "costate", "t", "p"]

    def along(name: str, expression: ca.SX) -> ca.Function:
        return ca.Function(name, inputs, [expression], names, [name])

    return Hamiltonian(
        value=along("hamiltonian", value),
        control_gradient=along("control_gradient", gradient),
        control_curvature=along("control_curvature", ca.densify(curvature)),
        costate_rate=along("costate_rate", -ca.densify(ca.gradient(value, m.x))),
        time_slope=along("time_slope", ca.densify(ca.gradient(value, m.t))),
        expressions=HamiltonianExpressions(costate, gradient, curvature),
    )
