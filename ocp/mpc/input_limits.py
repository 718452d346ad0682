"""Every row that limits what is sent, and the nearest input that meets them all."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp.codegen.buffered_function import BufferedFunction
from ocp.codegen.buffered_nlp import QUIET, BufferedNlp
from ocp.mpc.plant_input import PlantInput
from ocp.problem.constraint import Box
from ocp.problem.constraint_rows import ConstraintRows
from ocp.problem.ocp import OCP

_OPTIONS = QUIET | {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.max_iter": 100,
    "ipopt.tol": 1e-10,
    "ipopt.constr_viol_tol": 1e-10,
    "ipopt.bound_relax_factor": 0.0,
}
# Rows of several controls count as met to this: they are met by a solver.
_SOLVED = 1e-9


class Instant(NamedTuple):
    """When an input acts: what its limits depend on.

    Attributes:
        x: state (nx,).
        t: time [s].
        p: parameters then (n_p,).
    """

    x: np.ndarray
    t: float
    p: np.ndarray


@dataclass(frozen=True, eq=False)
class InputLimits:
    r"""Bounds of the input and of its rate, and the path constraints that limit it.

    .. math:: \min_v \; |v - u|^2 \quad \text{s.t.} \quad \underline u \le v \le \overline u,
              \quad \underline d \le d(x, v, t, p) \le \overline d

    for the rows d that limit the input (``Constraint.limits_input``), such as a bound that varies
    with time, and for its change since the last input, in continuous time divided by the interval.
    Where they exclude each other the bounds of the input win.

    Attributes:
        ocp: the problem.
        applied: what the plant receives; of a rate the path constraints, which are those of the
            controls, say nothing.
        dt: sampling interval [s].
    """

    ocp: OCP
    applied: PlantInput
    dt: float

    def nearest(self, given: np.ndarray, at: Instant) -> np.ndarray:
        """Return the input (m,) within all limits that is nearest to the given one.

        The given one itself where it is inside; not finite where it is not.
        """
        # Nearly all inputs are inside, and plain numbers say so sooner than numpy does.
        each = zip(given.tolist(), *self._bounds, strict=True)
        if all([low <= value <= high for value, low, high in each]) and self._rows_hold(given, at):
            return given
        if not np.isfinite(given).all():
            return given.copy()
        return self._moved(given, at)

    def _rows_hold(self, given: np.ndarray, at: Instant) -> bool:
        if not self._rows:
            return True
        is_exact = self._columns is not None and not self.ocp.rates
        slack = 0.0 if is_exact else _SOLVED
        return bool(self._rows.excess(self._values(given, at)).max(initial=0.0) <= slack)

    def _values(self, u: np.ndarray, at: Instant) -> np.ndarray:
        return self._function(at.x, u, at.t, at.p)[0].ravel()

    def _moved(self, given: np.ndarray, at: Instant) -> np.ndarray:
        """Solve for the nearest input: at once where each row limits one control by itself."""
        bounds = self.applied.box(self.ocp)
        inside = bounds.clip(given)
        if not self._rows or self._rows_hold(inside, at):
            return inside
        is_known = np.isfinite(self._values(inside, at))
        if not is_known.all() and not (self._columns is not None and self.ocp.rates):
            return inside
        if self._columns is not None:
            return self._interval(bounds, at).clip(inside)
        # A start at which a slope vanishes, as the middle of a ring, leads nowhere: others may.
        starts = [inside, *(bounds.clip(inside + step) for step in self._steps)]
        tried = (self._solved(given, start, at) for start in starts)
        inputs = (found for found in tried if np.isfinite(found).all())
        return next((found for found in inputs if self._rows_hold(found, at)), inside)

    def _solved(self, given: np.ndarray, start: np.ndarray, at: Instant) -> np.ndarray:
        bounds, box = self.applied.box(self.ocp), self._rows.box
        inputs = {
            "x0": start,
            "p": np.concatenate([given, at.x, [at.t], at.p]),
            "lbx": bounds.lower,
            "ubx": bounds.upper,
            "lbg": box.lower,
            "ubg": box.upper,
        }
        found, _ = self._nearest(inputs)
        return bounds.clip(found["x"])

    def exceeded(self, given: np.ndarray, at: Instant) -> str:
        """Return which row an input leaves, and by how much, in words; empty where none is left."""
        if self._rows_hold(given, at):
            return ""
        values = self._values(given, at)[None, :]
        if not np.isfinite(values).all():
            return "without a measurement a limit of the input is not known"
        return str(self._rows.largest_violation(values, np.array([at.t])))

    def _interval(self, bounds: Box, at: Instant) -> Box:
        """Return bounds of the input that rows of one control each leave, within its own."""
        assert self._columns is not None
        zero = np.zeros(self.ocp.model.nu)
        offset = self._values(zero, at)
        slopes = np.array([self._values(e, at) - offset for e in np.eye(len(zero))])
        lower, upper = np.array(bounds.lower, dtype=float), np.array(bounds.upper, dtype=float)
        box = self._rows.box
        for i, j in enumerate(self._columns):
            slope = slopes[j, i]
            if slope == 0.0 or not np.isfinite(slope + offset[i]):
                continue
            ends = (np.array([box.lower, box.upper])[:, i] - offset[i]) / slope
            lower[j] = max(lower[j], ends.min())
            upper[j] = min(upper[j], ends.max())
        return Box(bounds.clip(lower), bounds.clip(np.maximum(lower, upper)))

    # -- prepared -------------------------------------------------------------------------------

    @cached_property
    def _bounds(self) -> tuple[list[float], list[float]]:
        return self.applied.limits(self.ocp)

    @cached_property
    def _rows(self) -> ConstraintRows:
        """The path constraints that limit the input, and what limits its change."""
        rows = self.ocp.rows.path.of_kind("input") + _changes(self.ocp, self.dt)
        return rows if self.applied.what == "control" else rows.where(np.zeros(len(rows)))

    @cached_property
    def _steps(self) -> np.ndarray:
        """Ways from a start to others, of the order of one, (6, m)."""
        return np.random.default_rng(0).normal(size=(6, self.ocp.model.nu))

    @cached_property
    def _function(self) -> BufferedFunction:
        m = self.ocp.model
        inputs = [m.x, m.u, m.t, self.ocp.p]
        return BufferedFunction(ca.Function("limits", inputs, [ca.densify(self._rows.expression)]))

    @cached_property
    def _columns(self) -> list[int] | None:
        """The control that each row is affine in, if it contains no other; else None."""
        u, rows = self.ocp.model.u, self._rows.expression
        if any(ca.which_depends(rows, u, 2, True)):
            return None
        structure = np.array(ca.DM(ca.jacobian_sparsity(rows, u), 1.0)) > 0.0
        if (structure.sum(axis=1) > 1).any():
            return None
        return structure.argmax(axis=1).tolist()

    @cached_property
    def _nearest(self) -> BufferedNlp:
        m, p = self.ocp.model, self.ocp.p
        given = ca.SX.sym("given", m.nu)
        program = {
            "x": m.u,
            "p": ca.vertcat(given, m.x, m.t, p),
            "f": ca.sumsqr(m.u - given),
            "g": self._rows.expression,
        }
        return BufferedNlp(ca.nlpsol("nearest", "ipopt", program, _OPTIONS))

    def prepare(self) -> None:
        """Build what a step may need, so that no step waits for it."""
        if self._rows and self._columns is None:
            _ = self._nearest


def _changes(ocp: OCP, dt: float) -> ConstraintRows:
    """Return the bounds of the rates as rows of the input and the last one, which is in p."""
    rates = ocp.control_rates
    if not len(rates):
        return ConstraintRows((), ca.SX(0, 1))
    last, index = ocp.given[-1].symbol, rates.index.tolist()
    rate = (ocp.model.u[index] - last) / (1.0 if ocp.model.is_discrete else dt)
    return ConstraintRows(ocp.rows.rates.rows, rate)
