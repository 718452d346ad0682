"""The residuals of measurements along a trajectory, and the sum of their squares."""

from collections.abc import Callable

import numpy as np

from ocp.problem.ocp import OCP
from ocp.problem.parameters import ParameterValues


def instant_fractions(ocp: OCP) -> np.ndarray:
    """Return all instants of data and constraints as fractions of the horizon, in order, (K,)."""
    each = [np.asarray(e.times) / ocp.duration for e in (*ocp.data, *ocp.at("instants"))]
    return np.minimum(np.unique(np.concatenate([np.zeros(0), *each])), 1.0)


def data_residuals(
    ocp: OCP,
    states: Callable[[np.ndarray], np.ndarray],
    t0: float,
    values: ParameterValues,
) -> dict[str, np.ndarray]:
    """Return (h - y) / sigma of every measurement by name, (K, m); NaN where there is no value.

    Args:
        ocp: the problem.
        states: fractions of the horizon (K,) -> states there (K, nx).
        t0: initial time [s].
        values: parameters and unknown constants.
    """
    found, first = {}, 0
    for m in ocp.data:
        times = np.asarray(m.times)
        fractions = np.minimum(times / ocp.duration, 1.0)
        x, p = states(fractions), values.at(fractions)
        h = ocp.functions.measured.map(len(times))(x.T, t0 + times[None, :], p.T)
        found[m.name] = m.residuals(np.array(h).T[:, first : first + m.size])
        first += m.size
    return found


def data_size(ocp: OCP) -> float:
    """Return what data would cost if all that is measured were 0."""
    return float(sum((m.weights * m.known**2).sum() for m in ocp.data))


def data_cost(residuals: dict[str, np.ndarray]) -> float:
    """Return the sum of the squares of all residuals."""
    return float(sum(np.nansum(each**2) for each in residuals.values()))
