r"""The largest value along the way, as a constant that nothing exceeds.

.. math:: \min J + w\, s \quad \text{s.t.} \quad g(x, u, t) \le s, \quad \dot s = 0

An epigraph of this one term: one of the whole cost leads Newton's method nowhere.
"""

from dataclasses import replace

import casadi as ca
import numpy as np

from ocp.normal_form.draft import AddedStates, Draft
from ocp.normal_form.origin import Origin
from ocp.problem.constraint import Constraint
from ocp.problem.ocp import OCP
from ocp.problem.peak import Peak
from ocp.problem.scaled import sizes_of


def add_peaks(draft: Draft) -> dict[str, slice]:
    """Replace every peak; return where its value stands, by name."""
    ocp, found = draft.ocp, {}
    if not ocp.peaks:
        return found
    sizes = _sizes(ocp)
    for peak, first in zip(ocp.peaks, _first_values(ocp), strict=True):
        top, size = ca.SX.sym(f"peak of {peak.name}"), sizes[peak.name]
        value = AddedStates.constant(ocp, top, np.array([first]), size=np.array([size]))
        found[peak.name] = draft.add_states(value, Origin(peak.name))
        draft.terminal_cost += peak.weight * top
        name = draft.unused(peak.name, Origin(peak.name, "peak"))
        below = Constraint(name, peak.rows() - top, upper=0.0, nominal=size)
        draft.constraints.append(below)
    return found


def largest(peaks: tuple[Peak, ...], values: np.ndarray) -> np.ndarray:
    """Return the largest value of each peak, (k,), of stacked rows at some instants (K, m)."""
    each = np.split(values, np.cumsum([peak.size for peak in peaks])[:-1], axis=1)
    return np.array([part.max() for part in each])


def _sizes(ocp: OCP) -> dict[str, float]:
    """Return the nominal sizes of what the peaks are taken of."""
    rows = tuple(Constraint(peak.name, peak.expression) for peak in ocp.peaks)
    sizes = sizes_of(replace(ocp, peaks=(), constraints=(*ocp.constraints, *rows))).rows
    return {peak.name: float(sizes[peak.name].max()) for peak in ocp.peaks}


def _first_values(ocp: OCP) -> np.ndarray:
    """Return the peaks at the start, without a control if that is within the bounds."""
    u = ocp.control_bounds.clip(np.zeros(ocp.model.nu))
    p = ocp.parameter_values().at(0.0)[0]
    values = largest(ocp.peaks, np.array(ocp.functions.peaks(ocp.start(), u, 0.0, p)).T)
    return np.where(np.isfinite(values), values, 0.0)
