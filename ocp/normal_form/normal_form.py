"""The normal form of a problem: what methods get, and where in it the user's terms stand."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import casadi as ca
import numpy as np

from ocp.normal_form.draft import Draft
from ocp.normal_form.input_delays import add_delays
from ocp.normal_form.input_rates import add_rates
from ocp.normal_form.integral_constraints import add_integrals
from ocp.normal_form.measurements import DataTerms, add_data
from ocp.normal_form.origin import Origin
from ocp.normal_form.peaks import add_peaks
from ocp.normal_form.soft_constraints import soften
from ocp.normal_form.unknown_constants import add_start, add_unknowns
from ocp.normal_form.waypoints import Waypoints, add_waypoints
from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.problem.parameters import ParameterValues
from ocp.problem.portable import Portable


@dataclass(frozen=True, eq=False)
class NormalForm(Portable):
    """A problem in simpler terms: more states and controls behind its own.

    Attributes:
        original: the problem as it was written.
        implicit: the one that methods get, with the algebraic variables of the original.
        unknowns: where unknown constants stand among its states, by name.
        integrals: where integrals stand among its states, by name of the constraint.
        start: where what terms contain of the state at the start stands among its states.
        from_start: which states of the original these are copies of.
        slacks: what the last controls stand for, in terms of the original.
        controls: where the own controls stand among its states and controls, (nu,).
        rates: which of its controls are the rates of those that are states, in their order.
        last_input: where the states stand that start at the last input.
        data: what measurements at instants have added; None: nothing.
        histories: where the states stand that start at what was sent before, by run argument.
        peaks: where the largest values stand among its states, by name.
        waypoints: what constraints at instants have added.
        origins: what the names that it adds stand for.
    """

    original: OCP
    implicit: OCP
    unknowns: dict[str, slice]
    integrals: dict[str, slice]
    start: slice
    from_start: tuple[int, ...]
    slacks: ca.SX
    controls: np.ndarray
    rates: np.ndarray
    last_input: slice
    histories: dict[str, slice]
    peaks: dict[str, slice]
    data: DataTerms | None
    waypoints: Waypoints
    origins: Mapping[str, Origin]

    def own_controls(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the controls of the original (..., nu) for states and controls of the problem."""
        return np.concatenate([x, u], axis=-1)[..., self.controls]

    @property
    def problem(self) -> OCP:
        """The one that methods get: the algebraic variables are solved for."""
        return self.implicit.explicit

    @property
    def given(self) -> dict[str, slice]:
        """Where the run arguments of the original that are starts here stand, by name."""
        free = self.original.last_input is None
        return self.histories | ({} if free else {"last_input": self.last_input})

    def copied(self, x: np.ndarray) -> np.ndarray:
        """Return what the copy of the start is for a state at the start (nx,)."""
        return x[list(self.from_start)]

    @cached_property
    def slack(self) -> ca.Function:
        """(x, u, t, p) -> the slacks among the controls that fit, p that of the original."""
        m, slacks = self.original.model, self.original.algebraic_solution(self.slacks)
        return ca.Function("slack", [m.x, m.u, m.t, self.original.p], [ca.densify(slacks)])

    def costate(
        self,
        x: np.ndarray,
        costate: np.ndarray,
        t: np.ndarray,
        fractions: np.ndarray,
        values: ParameterValues,
        side: Literal[-1, 1] = -1,
    ) -> np.ndarray:
        """Return costates (K, nx) of the original, just before instants at which they jump.

        Args:
            x: states of the rewritten problem (K, n).
            costate: of it (K, n).
            t: instants [s], (K,).
            fractions: the same as fractions of the horizon.
            values: parameters of the rewritten problem.
            side: 1: just behind these instants instead.
        """
        own = costate[:, : self.original.model.nx]
        if not self.has_jumps:
            return own
        p, places = values.at(fractions, side), self.waypoints.places.values()
        prices = np.hstack([np.zeros((len(t), 0)), *[costate[:, at] for at in places]])
        passed = np.array(self._jump.map(len(t))(x.T, t[None, :], p.T, prices.T)).T
        return own - np.where((fractions[:, None] > 0.0) | (side > 0), passed, 0.0)

    @property
    def has_jumps(self) -> bool:
        """Whether costates of the original jump at instants."""
        return self.data is not None or bool(self.waypoints.places)

    def integrated_data(self, x: np.ndarray, t: float, values: ParameterValues) -> float:
        """Return what data cost at the end and by the integral, for the last state (n,)."""
        if self.data is None:
            return 0.0
        return float(self._at_end(x, t, values.at(1.0)[0])) - float(x[self.data.integral])

    @cached_property
    def _at_end(self) -> ca.Function:
        assert self.data is not None
        m = self.problem.model
        return ca.Function("data", [m.x, m.t, self.problem.p], [self.data.at_end])

    @cached_property
    def _jump(self) -> ca.Function:
        m, jump = self.problem.model, self.waypoints.jump
        if self.data is not None:
            jump = jump + self.data.slope
        given = [m.x, m.t, self.problem.p, self.waypoints.prices]
        return ca.Function("jump", given, [ca.densify(jump)])


@once_per_problem
def normal_form(ocp: OCP) -> NormalForm | None:
    """Return the normal form of a problem; None where it is written in simple terms already."""
    is_soft = any(c.soft is not None for c in ocp.constraints)
    along = ocp.rates or ocp.delays or ocp.peaks or ocp.at("integral")
    at_instants = ocp.data or ocp.at("instants")
    constants = ocp.unknowns or ocp.refers_to_start
    if not (along or at_instants or constants or is_soft or ocp.model.nz):
        return None
    draft = Draft.of(ocp)
    last_input = add_rates(draft)
    histories = add_delays(draft)
    slacks = soften(draft)
    integrals = add_integrals(draft)
    data, waypoints = add_data(draft), add_waypoints(draft)
    from_start = ocp.used_of_start
    start = add_start(draft, from_start)
    peaks = add_peaks(draft)
    unknowns = add_unknowns(draft)
    return NormalForm(
        original=ocp,
        implicit=draft.problem(),
        unknowns=unknowns,
        integrals=integrals,
        start=start,
        from_start=from_start,
        slacks=slacks,
        controls=draft.own_controls(),
        rates=len(draft.kept) + np.arange(len(draft.moved)),
        last_input=last_input,
        data=data,
        waypoints=waypoints,
        origins=draft.origins,
        histories=histories,
        peaks=peaks,
    )
