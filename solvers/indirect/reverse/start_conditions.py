"""The conditions of reverse shooting at t0, and the problems that it refuses."""

import casadi as ca
import numpy as np

from ocp import OCP, UnsupportedProblem
from ocp.internal import refuse_state_bounds


def refuse_what_reverse_cannot(ocp: OCP) -> None:
    """Raise for terms that a reverse integration has no place for.

    Raises:
        UnsupportedProblem: naming the term.
    """
    for c in ocp.at("path"):
        raise UnsupportedProblem(
            f"{ocp.name}: reverse integration takes no path constraint ('{c.name}')"
        )
    refuse_state_bounds(ocp, "reverse integration")
    for name in ocp.control_rates.names:
        raise UnsupportedProblem(f"{ocp.name}: reverse integration takes no Rate ('{name}')")
    if ocp.free_start:
        raise UnsupportedProblem(
            f"{ocp.name}: reverse integration takes a start that is given or on a manifold, not "
            f"free in parts ('{ocp.free_start[0]}')"
        )
    if ocp.has_free_time:
        raise UnsupportedProblem(f"{ocp.name}: reverse integration needs a fixed final time")


def transversality(ocp: OCP) -> ca.Function:
    """Return (z, t, p) -> (c, N psi) of the initial constraints, and its derivative in z.

    N projects on the tangent space of c = 0. Source: thesis (3.45), (3.46) and (3.52), with the
    bracket closed before psi.
    """
    m = ocp.model
    c = ca.vertcat(
        *[entry.expression - ca.DM(np.asarray(entry.lower)) for entry in ocp.at("initial")]
    )
    costate = ca.SX.sym("costate", m.nx)
    tangential = costate
    if c.numel():
        slope = ca.jacobian(c, m.x)
        gram = ca.mtimes(slope, slope.T)
        tangential = costate - ca.mtimes(slope.T, ca.solve(gram, ca.mtimes(slope, costate)))
    z = ca.vertcat(m.x, costate)
    value = ca.densify(ca.vertcat(c, tangential))
    return ca.Function(
        "transversality", [z, m.t, ocp.p], [value, ca.densify(ca.jacobian(value, z))]
    )
