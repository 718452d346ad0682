"""Pontryagin's minimum principle of a problem, derived symbolically, once."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ocp.checks.arguments import check_instance
from ocp.checks.errors import UnsupportedProblem
from ocp.checks.rich_text import counted
from ocp.minimum_principle.hamiltonian import Hamiltonian, hamiltonian
from ocp.minimum_principle.minimising_control import minimising_control
from ocp.problem.cache import once_per_problem
from ocp.problem.constraint import Constraint
from ocp.problem.functions import stacked
from ocp.problem.kinks import kink_in_control
from ocp.problem.ocp import OCP
from ocp.problem.scaled import scaled

# H_uu with a smaller reciprocal condition number does not determine the control.
_SINGULAR = 1e-10


@dataclass(frozen=True, eq=False)
class MinimumPrinciple:
    r"""The necessary conditions of a minimum.

    .. math::

        \dot x = H_\lambda', \quad \dot\lambda = -H_x', \quad u^* = \arg\min_u H

    Source: thesis (3.35) to (3.47), [Bryson & Ho 1975].

    Attributes:
        hamiltonian: H and its derivatives.
        control: (x, costate, t, p) -> the minimising control (nu,), within its bounds.
        flow: (z, t, p) -> dz/dt for z = (x, costate), with the minimising control.
        start: (x, costate, mu, t, p, x0) -> what must vanish at t0 where the start is free:
            c, of the initial constraints and of what is given of the start, x - x0; and
            costate + c_x' mu (the costate is then normal to the manifold, thesis 3.45).
        end: (x, costate, nu, t, p) -> what must vanish at the final time:
            costate - phi_x - psi_x' nu; the terminal constraints psi; and where the final
            time is free H + phi_t + nu' psi_t.
    """

    hamiltonian: Hamiltonian
    control: ca.Function
    flow: ca.Function
    start: ca.Function
    end: ca.Function

    def __repr__(self) -> str:
        """Return one line: of how many states and controls."""
        nx, nu = self.control.numel_in(0), self.control.numel_out(0)
        return f"<MinimumPrinciple: {counted(nx, 'state')}, {counted(nu, 'control')}>"


@once_per_problem
def minimum_principle(ocp: OCP) -> MinimumPrinciple:
    """Derive the minimum principle of a continuous-time problem, see ``MinimumPrinciple``.

    Args:
        ocp: the problem; path constraints and state bounds play no part.

    Raises:
        UnsupportedProblem: for a discrete-time model, a Hamiltonian that is linear in a
            control (bang-bang or singular arcs) or whose minimiser is not unique, and for
            terminal or initial inequalities, and signals under a free final time.
    """
    if ocp.model.is_discrete:
        raise UnsupportedProblem(
            f"{ocp.name}: the minimum principle here is that of continuous time"
        )
    signals = [entry.name for entry in ocp.moving]
    if ocp.has_free_time and signals:
        raise UnsupportedProblem(
            f"{ocp.name}: signal '{signals[0]}' stretches with the free final time, which "
            "H + phi_t = 0 does not know of; use a direct method, or write it as a function of t"
        )
    h = hamiltonian(ocp)
    _require_regular(ocp, h)
    control = minimising_control(ocp, h)
    return MinimumPrinciple(
        hamiltonian=h,
        control=control,
        flow=_flow(ocp, control, h),
        start=_start(ocp),
        end=_end(ocp, control, h),
    )


def _require_regular(ocp: OCP, h: Hamiltonian) -> None:
    """Refuse a Hamiltonian that does not determine the control."""
    m = ocp.model
    if m.nu == 0:  # nothing to determine
        return
    for i, name in enumerate(m.u_names):
        if h.expressions.curvature[i, :].nnz() == 0:
            raise UnsupportedProblem(
                f"{ocp.name}: the Hamiltonian is linear in the control {name}: its minimum is "
                "bang-bang or singular; use a direct method"
            )
    if kink := kink_in_control(ocp):
        raise UnsupportedProblem(
            f"{ocp.name}: the Hamiltonian has a kink in a control, in {kink}, where its minimum "
            "is no zero of H_u; use a direct method, or without_kinks(problem)"
        )
    hessians = _probed_curvatures(ocp, h)
    scales = [_SINGULAR * (1.0 + np.abs(a).max()) for a in hessians]
    if all(np.linalg.matrix_rank(a, tol=s) < m.nu for a, s in zip(hessians, scales, strict=True)):
        raise UnsupportedProblem(
            f"{ocp.name}: H_uu is singular, the Hamiltonian does not determine the control; "
            "add the cost of the directions without effect (for a redundant arm: the "
            "regularised running cost)"
        )
    if all(np.linalg.eigvalsh(a)[0] < -s for a, s in zip(hessians, scales, strict=True)):
        raise UnsupportedProblem(
            f"{ocp.name}: H_uu is not positive definite: the Hamiltonian is not convex in the "
            "control, and a zero of H_u no minimum of it; use a direct method"
        )


def _probed_curvatures(ocp: OCP, h: Hamiltonian) -> list[np.ndarray]:
    """H_uu at the start, for no costate and no control and for a few random ones.

    Of a problem that is badly scaled in the sizes of cost, states and controls.
    """
    m, rng = ocp.model, np.random.default_rng(0)
    p = ocp.parameter_values().at(0.0)[0]
    x, u, cost = np.ones(m.nx), np.ones(m.nu), 1.0
    if (in_sizes := scaled(ocp)) is not None:
        x, u, cost = in_sizes.sizes.x, in_sizes.sizes.u, in_sizes.sizes.cost
    costates = [np.zeros(m.nx), *rng.normal(size=(5, m.nx)) * (cost / x)]
    controls = [np.zeros(m.nu), *rng.normal(size=(5, m.nu)) * u]
    probes = zip(costates, ocp.control_bounds.clip(np.array(controls)), strict=True)
    found = [np.array(h.control_curvature(ocp.start(), v, c, 0.0, p)) for c, v in probes]
    return [curvature * np.outer(u, u) / cost for curvature in found]


def _flow(ocp: OCP, control: ca.Function, h: Hamiltonian) -> ca.Function:
    m = ocp.model
    kind = symbol_type(control)
    z, t, p = kind.sym("z", 2 * m.nx), kind.sym("t"), kind.sym("p", ocp.p.numel())
    x, costate = z[: m.nx], z[m.nx :]
    u = control(x, costate, t, p)
    rate = ca.vertcat(ocp.functions.rate(x, u, t, p), h.costate_rate(x, u, costate, t, p))
    return ca.Function("flow", [z, t, p], [rate], ["z", "t", "p"], ["rate"])


def _start(ocp: OCP) -> ca.Function:
    m = ocp.model
    costate = ca.SX.sym("costate", m.nx)
    x0 = ca.SX.sym("x0", m.nx)
    given = np.flatnonzero(~ocp.start_is_free).tolist() if ocp.has_free_start else []
    c = ca.vertcat(_equations(ocp, ocp.at("initial")), (m.x - x0)[given, :])
    mu = ca.SX.sym("mu", c.numel())
    normal = costate + ca.mtimes(ca.jacobian(c, m.x).T, mu)
    names = ["x", "costate", "mu", "t", "p", "x0"]
    inputs = [m.x, costate, mu, m.t, ocp.p, x0]
    return ca.Function("start", inputs, [ca.vertcat(c, normal)], names, ["residual"])


def _end(ocp: OCP, control: ca.Function, h: Hamiltonian) -> ca.Function:
    m = ocp.model
    costate = ca.SX.sym("costate", m.nx)
    psi = _equations(ocp, ocp.at("terminal"))
    nu = ca.SX.sym("nu", psi.numel())
    bolza = ocp.terminal_cost + ca.dot(nu, psi)
    left_over = ca.vertcat(costate - ca.gradient(bolza, m.x), psi)
    conditions = ca.Function(
        "conditions", [m.x, costate, nu, m.t, ocp.p], [left_over, ca.gradient(bolza, m.t)]
    )
    sizes = {"x": m.nx, "costate": m.nx, "nu": nu.numel(), "t": 1, "p": ocp.p.numel()}
    kind = symbol_type(control)
    inputs = [kind.sym(name, size) for name, size in sizes.items()]
    x, lam, _, t, p = inputs
    residual, bolza_t = conditions(*inputs)
    if ocp.has_free_time:
        residual = ca.vertcat(residual, h.value(x, control(x, lam, t, p), lam, t, p) + bolza_t)
    return ca.Function("end", inputs, [residual], list(sizes), ["residual"])


def symbol_type(function: ca.Function) -> Any:
    """Return the symbol class a function can be used with: MX if it holds a root finder."""
    check_instance(function, ca.Function, "symbol_kind: the function")
    return ca.SX if function.is_a("SXFunction") else ca.MX


def _equations(ocp: OCP, constraints: tuple[Constraint, ...]) -> ca.SX:
    """Return what must vanish, or refuse an inequality."""
    for c in constraints:
        if not c.is_equation:
            raise UnsupportedProblem(
                f"{ocp.name}: the {c.at} constraint '{c.name}' is an inequality; the minimum "
                "principle here takes equations at the ends; use a direct method"
            )
    lowers = ca.vertcat(ca.DM(0, 1), *[ca.DM(np.asarray(c.lower)) for c in constraints])
    return stacked(constraints) - lowers
