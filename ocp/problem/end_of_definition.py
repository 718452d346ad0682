"""Where a trajectory comes to the end of what its problem defines, such as of a table."""

import casadi as ca
import numpy as np

from ocp.problem.called_functions import undefined_call
from ocp.problem.ocp import OCP


def end_of_definition(ocp: OCP, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> str:
    """Return which function has no value along a trajectory, and when; "" if none is found.

    Args:
        ocp: the problem.
        t: instants (k,) [s].
        x: states there (k, nx).
        u: controls (k, nu).
        p: parameters (k, n_p).
    """
    if not ocp.functions.called:
        return ""
    ocp = ocp.explicit
    m = ocp.model
    terms = ca.vertcat(m.f, ocp.running_cost, *[c.expression for c in ocp.at("path")])
    points = np.column_stack([x, u, t, p])
    found = undefined_call(terms, ca.vertcat(m.x, m.u, m.t, ocp.p), points)
    return f"near t = {t[found.point]:.4g} s, {found.said}" if found else ""
