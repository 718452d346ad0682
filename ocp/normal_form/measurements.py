r"""Least squares at instants, as an integral and a cost at the end.

For the cost :math:`\varphi_i(x) = \sum_c w_{ic} (h_c(x, t) - y_{ic})^2` at the instant t_i,

.. math::
    \varphi_i(x(t_i)) = \varphi_i(x(t_f)) - \int_{t_i}^{t_f} \dot \varphi_i \, dt ,

so that all of them are one cost at the end and one integral e, whose integrand

.. math::
    \dot e = 2 \sum_c \dot h_c \, (W_c h_c - Y_c), \qquad
    W(t) = \sum_{t_i \le t} w_i, \quad Y(t) = \sum_{t_i \le t} w_i y_i, \quad
    \dot h = h_x f + h_t

jumps at the instants, where grids have nodes. This is exact, for every method. The costates that
come back jump there: they are those of the integral form less :math:`2 h_x' (W h - Y)`. In discrete
time the cost of an instant is that of its step.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.normal_form.draft import AddedStates, Draft
from ocp.normal_form.origin import Origin
from ocp.problem.constraint import Box
from ocp.problem.functions import stacked
from ocp.problem.ocp import OCP
from ocp.problem.portable import Portable

# Instants nearer than this, in fractions of the horizon, are one.
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class DataTerms(Portable):
    """What data have added to a problem.

    Attributes:
        slope: 2 h_x' (W h - Y), (nx,).
        at_end: the cost of all data, were the state always the last one.
        integral: where e stands among the states.
    """

    slope: ca.SX
    at_end: ca.SX
    integral: int


def add_data(draft: Draft) -> DataTerms | None:
    """Write the least squares in simpler terms; None where methods keep their costates."""
    ocp = draft.ocp
    if not ocp.data:
        return None
    solved, (instants, weights, values) = ocp.algebraic_solution, _table(ocp)
    h = solved(stacked(ocp.data))
    if ocp.model.is_discrete:
        _add_steps(draft, h, instants, weights, values)
        return None
    inner = instants[(instants > _SAME) & (instants < 1.0 - _SAME)]
    seen = np.array([instants <= edge + _SAME for edge in (0.0, *inner)], dtype=float)
    w, y = (ca.SX.sym(f"{what} of data", h.numel()) for what in ("weight", "weighted mean"))
    levels = np.hstack([seen @ weights, seen @ (weights * values)])
    draft.add_steps("data", ca.vertcat(w, y), inner, levels)
    model = ocp.model
    along = ca.jacobian(h, model.x) @ solved(model.f) + ca.jacobian(h, model.t)
    at_end, typical = _end(h, weights, values)
    e = ca.SX.sym("integral of data")
    place = draft.add_states(
        AddedStates(
            symbol=e,
            rate=2 * ca.dot(along, w * h - y),
            start=np.zeros(1),
            is_free=False,
            box=Box.unbounded(1),
            size=np.array([typical]),
        ),
        Origin(ocp.data[0].name if len(ocp.data) == 1 else "data"),
    )
    draft.terminal_cost += at_end - e
    slope = 2 * ca.jacobian(h, model.x).T @ (w * h - y)
    return DataTerms(slope, at_end, place.start)


def _table(ocp: OCP) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return all instants as fractions (K,), and weights and values of all rows there, (K, m)."""
    fractions = [np.asarray(m.times) / ocp.duration for m in ocp.data]
    instants = np.unique(np.concatenate(fractions))
    instants = instants[np.diff(instants, prepend=-1.0) > _SAME]
    weights = np.zeros((len(instants), sum(m.size for m in ocp.data)))
    values, first = np.zeros_like(weights), 0
    for m, each in zip(ocp.data, fractions, strict=True):
        rows = np.abs(instants[:, None] - each).argmin(axis=0)
        columns = slice(first, first + m.size)
        weights[rows, columns], values[rows, columns] = m.weights, m.known
        first += m.size
    return instants, weights, values


def _end(h: ca.SX, weights: np.ndarray, values: np.ndarray) -> tuple[ca.SX, float]:
    """Return the cost of all data were the state always the same, and a typical one."""
    total = weights.sum(axis=0)
    mean = (weights * values).sum(axis=0) / total
    spread = float((weights * (values - mean) ** 2).sum())
    typical = float((weights * values**2).sum())
    return ca.dot(ca.DM(total), (h - ca.DM(mean)) ** 2) + spread, typical or 1.0


def _add_steps(
    draft: Draft, h: ca.SX, instants: np.ndarray, weights: np.ndarray, values: np.ndarray
) -> None:
    steps = draft.ocp.steps or 1
    at = np.round(instants * steps).astype(int)
    table = np.zeros((steps + 1, 2 * h.numel()))
    table[at] = np.hstack([weights, values])
    w, y = (ca.SX.sym(f"{what} of data", h.numel()) for what in ("weight", "value"))
    between = (np.arange(steps) + 0.5) / steps
    draft.add_steps("data", ca.vertcat(w, y), between, table)
    cost = ca.dot(w, (h - y) ** 2)
    draft.running_cost += cost
    draft.terminal_cost += cost
