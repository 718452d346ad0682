"""An extremal between its nodes: along its canonical flow, with the minimising control."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.interpolate import PPoly

from ocp.minimum_principle.necessary_conditions import minimum_principle
from ocp.normal_form.normal_form import NormalForm
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData


@dataclass(frozen=True, eq=False)
class Extremal:
    """An extremal of a problem that is its own normal form.

    Attributes:
        problem: what was solved.
        data: the numbers of the run.
        t: nodes [s], (N + 1,).
        x: states there, (N + 1, nx).
        costate: costates there, (N + 1, nx).
    """

    problem: OCP
    data: RunData
    t: np.ndarray
    x: np.ndarray
    costate: np.ndarray

    def state(self, t: np.ndarray) -> np.ndarray:
        """Return the state at times [s] of any shape, (..., nx)."""
        return self._canonical(t)[..., : self.problem.model.nx]

    def costate_at(self, t: np.ndarray) -> np.ndarray:
        """Return the costate at times [s] of any shape, (..., nx)."""
        return self._canonical(t)[..., self.problem.model.nx :]

    def control(self, t: np.ndarray) -> np.ndarray:
        """Return the control at times [s] of at most one axis, (..., nu).

        It minimises the Hamiltonian.
        """
        points = np.atleast_1d(t)
        p = self.data.values.at((points - self.t[0]) / (self.t[-1] - self.t[0]))
        law = minimum_principle(self.problem).control
        args = (self.state(points), self.costate_at(points), points[:, None], p)
        values = np.array(law.map(len(points))(*[a.T for a in args])).T
        return values if t.ndim else values[0]

    def _canonical(self, t: np.ndarray) -> np.ndarray:
        """State and costate; beyond the ends those of the ends."""
        return self._cubics(np.clip(t, self.t[0], self.t[-1]))

    @cached_property
    def _cubics(self) -> PPoly:
        """State and costate with the slopes of the flow; signals may jump at the nodes."""
        z, steps = np.hstack([self.x, self.costate]), np.diff(self.t)[:, None]
        fractions = (self.t - self.t[0]) / (self.t[-1] - self.t[0])
        flow = minimum_principle(self.problem).flow.map(len(steps))
        p_start, p_end = self.data.values.on(fractions)
        slope = np.array(flow(z[:-1].T, self.t[None, :-1], p_start.T)).T
        slope_end = np.array(flow(z[1:].T, self.t[None, 1:], p_end.T)).T
        secant = np.diff(z, axis=0) / steps
        square = (3 * secant - 2 * slope - slope_end) / steps
        cube = (slope + slope_end - 2 * secant) / steps**2
        return PPoly(np.stack([cube, square, slope, z[:-1]]), self.t)


class _NormalSolution(Protocol):
    """What of the ``Solution`` of a normal form is asked: its own file is built on this one."""

    @property
    def t(self) -> np.ndarray: ...

    @property
    def data(self) -> RunData: ...

    def state(self, t: np.ndarray) -> np.ndarray: ...

    def costate_at(self, t: np.ndarray) -> np.ndarray: ...

    def control(self, t: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class RewrittenExtremal:
    """The same of a problem that was solved in its normal form: what is read off the other's.

    Attributes:
        form: the normal form.
        normal: its solution.
    """

    form: NormalForm
    normal: _NormalSolution

    def state(self, t: np.ndarray) -> np.ndarray:
        """Return the state at times [s] of at most one axis, (..., nx)."""
        return self.normal.state(t)[..., : self.form.original.model.nx]

    def costate_at(self, t: np.ndarray) -> np.ndarray:
        """Return the costate at times [s] of at most one axis, (..., nx)."""
        nx, costate = self.form.original.model.nx, self.normal.costate_at(t)
        if not self.form.has_jumps:
            return costate[..., :nx]
        nodes, points = self.normal.t, np.atleast_1d(t)
        fractions = (points - nodes[0]) / (nodes[-1] - nodes[0])
        x, values = np.atleast_2d(self.normal.state(t)), self.normal.data.values
        own = self.form.costate(x, np.atleast_2d(costate), points, fractions, values)
        return own.reshape(*t.shape, nx)

    def control(self, t: np.ndarray) -> np.ndarray:
        """Return the control at times [s] of at most one axis, (..., nu)."""
        return self.form.own_controls(self.normal.state(t), self.normal.control(t))
