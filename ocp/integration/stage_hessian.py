"""The second derivatives of a stage, put together from those of one slope."""

import casadi as ca

from ocp.checks.arguments import check_instance
from ocp.integration.one_step import Integrator
from ocp.integration.stage_tape import StageInputs, StageTape
from ocp.problem.ocp import OCP


def stage_hessian(ocp: OCP, integrator: Integrator) -> ca.Function:
    r"""Return a held stage with its exact first and second derivatives.

    With w = (x, u), the state F(w) after the stage, its cost l(w) and the costate p after it:

    .. math:: (x, u, t, h, p_0, p_1, p) \mapsto
              (F, \; l, \; F_w, \; (l + p'F)_w, \; (l + p'F)_{ww})

    of shapes (nx,), (), (nx, nw), (nw,), (nw, nw); F and l are those of ``Stage``.

    Every slope k_i = g(z_i) of the integrator is a function of z_i = (x + a_i h k_{i-1}, u). Its
    derivatives J_i = g_z and, for a weight m, H_i = (m'g)_zz are functions of their own,
    called for each slope, so that the code does not grow with the number of slopes and steps.
    The Jacobian follows the slopes forwards, the weights of the slopes (the adjoint of the
    step) backwards, and with Z_i = dz_i/dw the second derivative is the sum of Z_i' H_i Z_i:
    curvature of anything but the slopes there is none. Written out for all slopes at once the
    same takes 4 to 8 times the code on arms with 3 to 6 links.
    Source: [Griewank & Walther 2008], chapter 5.

    Args:
        ocp: the problem; what depends on a free final time is left out.
        integrator: one-step method.
    """
    check_instance(ocp, OCP, "stage_hessian: the problem")
    m, n_p = ocp.model, ocp.p.numel()
    sizes = {"x": m.nx, "u": m.nu, "t": 1, "h": 1, "p0": n_p, "p1": n_p}
    s = {name: ca.MX.sym(name, size) for name, size in sizes.items()}
    costate = ca.MX.sym("costate", m.nx)
    tape = StageTape.of(ocp, integrator, StageInputs(**s))
    end = tape.end
    slope = end.cost_gradient.T + end.state_jacobian.T @ costate
    outputs = [end.x, end.cost, end.state_jacobian, slope, tape.hessian(costate, ca.MX(1))]
    names = ["x_next", "cost", "jacobian", "slope", "hessian"]
    return ca.Function("stage_hessian", [*s.values(), costate], outputs, [*s, "costate"], names)
