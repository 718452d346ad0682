"""A function of a problem along a guess that is sampled."""

import casadi as ca
import numpy as np

from ocp.problem.ocp import OCP


def along_guess(
    ocp: OCP, function: ca.Function, fractions: np.ndarray, x: np.ndarray | None, u: np.ndarray
) -> np.ndarray:
    """Return the values of a function of (x, u, t, p), stacked, (k, m), for declared parameters.

    Args:
        ocp: the problem.
        function: of one output (m,).
        fractions: of the horizon, (k,).
        x: states, (k, nx); None: the start.
        u: controls, (k, nu).
    """
    x = np.tile(ocp.start(), (len(u), 1)) if x is None else x
    p, t = ocp.parameter_values().at(fractions), fractions[None, :] * ocp.duration
    return np.array(function.map(len(u))(x.T, u.T, t, p.T)).T
