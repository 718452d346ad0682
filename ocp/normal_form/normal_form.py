"""The normal form of a problem: what methods get, and where in it the user's terms stand."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.normal_form.draft import Draft
from ocp.normal_form.input_delays import add_delays
from ocp.normal_form.input_rates import add_rates
from ocp.normal_form.integral_constraints import add_integrals
from ocp.normal_form.peaks import add_peaks
from ocp.normal_form.soft_constraints import soften
from ocp.normal_form.unknown_constants import add_start, add_unknowns
from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.problem.portable import Portable


@dataclass(frozen=True, eq=False)
class NormalForm(Portable):
    """A problem in simpler terms: more states and controls behind its own.

    Attributes:
        original: the problem as it was written.
        problem: the one that methods get.
        unknowns: where unknown constants stand among its states, by name.
        integrals: where integrals stand among its states, by name of the constraint.
        start: where the state at the start stands among its states; nowhere where no term has it.
        slacks: what the last controls stand for, in terms of the original.
        controls: where the own controls stand among its states and controls, (nu,).
        rates: which of its controls are the rates of those that are states, in their order.
        last_input: where the states stand that start at the last input.
        histories: where the states stand that start at what was sent before, by run argument.
        peaks: where the largest values stand among its states, by name.
    """

    original: OCP
    problem: OCP
    unknowns: dict[str, slice]
    integrals: dict[str, slice]
    start: slice
    slacks: ca.SX
    controls: np.ndarray
    rates: np.ndarray
    last_input: slice
    histories: dict[str, slice]
    peaks: dict[str, slice]

    def own_controls(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the controls of the original (..., nu) for states and controls of the problem."""
        return np.concatenate([x, u], axis=-1)[..., self.controls]

    @property
    def given(self) -> dict[str, slice]:
        """Where the run arguments of the original that are starts here stand, by name."""
        free = self.original.last_input is None
        return self.histories | ({} if free else {"last_input": self.last_input})

    def copied(self, x: np.ndarray) -> np.ndarray:
        """Return what the copy of the start is for a state at the start (nx,)."""
        return x[: self.start.stop - self.start.start]

    @cached_property
    def slack(self) -> ca.Function:
        """(x, u, t, p) -> the slacks among the controls that fit, p that of the original."""
        m = self.original.model
        return ca.Function("slack", [m.x, m.u, m.t, self.original.p], [ca.densify(self.slacks)])


@once_per_problem
def normal_form(ocp: OCP) -> NormalForm | None:
    """Return the normal form of a problem; None where it is written in simple terms already."""
    is_soft = any(c.soft is not None for c in ocp.constraints)
    about_input = ocp.rates or ocp.delays
    has_states = ocp.unknowns or ocp.peaks or ocp.at("integral") or ocp.refers_to_start
    if not (has_states or about_input or is_soft):
        return None
    draft = Draft.of(ocp)
    last_input = add_rates(draft)
    histories = add_delays(draft)
    slacks = soften(draft)
    integrals = add_integrals(draft)
    peaks = add_peaks(draft)
    start = add_start(draft)
    unknowns = add_unknowns(draft)
    return NormalForm(
        original=ocp,
        problem=draft.problem(),
        unknowns=unknowns,
        integrals=integrals,
        start=start,
        slacks=slacks,
        controls=draft.own_controls(),
        rates=len(draft.kept) + np.arange(len(draft.moved)),
        last_input=last_input,
        histories=histories,
        peaks=peaks,
    )
