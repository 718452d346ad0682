"""The minimum principle as Functions of z = (x, costate): a step of its flow, both ends."""

import casadi as ca

from ocp import OCP, Integrator, MinimumPrinciple
from ocp.internal import interpolate, symbol_type


def canonical_step(
    ocp: OCP, optimality: MinimumPrinciple, integrator: Integrator
) -> tuple[ca.Function, ca.Function]:
    """Return one step of the canonical flow (thesis 3.40, 3.41), and its derivatives.

    The step maps (z, T, t0, fraction, share, p0, p1) to z and the running cost after the
    fraction ``share`` of the horizon T, begun at t0 + fraction T; the parameters run from p0
    to p1. Its derivatives are those of z in z, (2 nx, 2 nx), and in T, (2 nx, 1).
    """
    nx, n_p = ocp.model.nx, ocp.p.numel()
    kind = symbol_type(optimality.flow)
    z, duration, t0 = kind.sym("z", 2 * nx), kind.sym("T"), kind.sym("t0")
    fraction, share = kind.sym("fraction"), kind.sym("share")
    p0, p1 = kind.sym("p0", n_p), kind.sym("p1", n_p)

    def rate(y, s):
        t, p = t0 + duration * (fraction + s * share), interpolate(p0, p1, s)
        u = optimality.control(y[:nx], y[nx : 2 * nx], t, p)
        cost = ocp.functions.running_cost(y[:nx], u, t, p)
        return duration * share * ca.vertcat(optimality.flow(y[: 2 * nx], t, p), cost)

    end = integrator(rate, ca.vertcat(z, 0), 0.0, 1.0)
    inputs = [z, duration, t0, fraction, share, p0, p1]
    names = ["z", "T", "t0", "fraction", "share", "p0", "p1"]
    derivatives = [ca.densify(ca.jacobian(end[: 2 * nx], v)) for v in (z, duration)]
    if kind is ca.SX:  # flow and cost share most of what they compute: half of a step's time
        end, derivatives = ca.cse([end])[0], ca.cse(derivatives)
    step = ca.Function("step", inputs, [end[: 2 * nx], end[2 * nx]], names, ["z_next", "cost"])
    return step, ca.Function("slope", inputs, derivatives, names, ["in_z", "in_T"])


def start_conditions(ocp: OCP, optimality: MinimumPrinciple) -> ca.Function:
    """Return (z, mu, t, p, x0) -> what vanishes at t0, and its derivatives in z and mu."""
    z = ca.SX.sym("z", 2 * ocp.model.nx)
    names = ("mu", "t", "p", "x0")
    mu, t, p, x0 = (ca.SX.sym(n, optimality.start.sparsity_in(n)) for n in names)
    value = optimality.start(z[: ocp.model.nx], z[ocp.model.nx :], mu, t, p, x0)
    derivatives = [ca.densify(ca.jacobian(value, v)) for v in (z, mu)]
    return ca.Function("starts", [z, mu, t, p, x0], [value, *derivatives])


def end_conditions(ocp: OCP, optimality: MinimumPrinciple) -> ca.Function:
    """Return (z, nu, t, p) -> what vanishes at the final time; derivatives in z, nu, t."""
    kind = symbol_type(optimality.end)
    z = kind.sym("z", 2 * ocp.model.nx)
    nu, t, p = (kind.sym(n, optimality.end.sparsity_in(n)) for n in ("nu", "t", "p"))
    value = optimality.end(z[: ocp.model.nx], z[ocp.model.nx :], nu, t, p)
    derivatives = [ca.densify(ca.jacobian(value, v)) for v in (z, nu, t)]
    return ca.Function("ends", [z, nu, t, p], [value, *derivatives])
