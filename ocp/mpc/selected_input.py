"""The input of a rung: read off a plan, or given by a law, and moved into its limits."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import NamedTuple

import numpy as np

from ocp.closed_loop.decision import InputSource
from ocp.mpc.input_limits import InputLimits, Instant
from ocp.mpc.plant_input import InputMap, PlantInput
from ocp.problem.constraint_rows import ImposedRows
from ocp.problem.ocp import OCP
from ocp.solution.shifted_plan import plan_controls
from ocp.solution.solution import Solution


class SelectedInput(NamedTuple):
    """An input of a rung.

    Attributes:
        source: the rung.
        input: within its bounds (m,).
        clipped: by how much it was moved to lie there.
        plan: that it comes from; None for the backup law.
    """

    source: InputSource
    input: np.ndarray
    clipped: float
    plan: Solution | None

    @property
    def is_new(self) -> bool:
        """Whether its plan was made at this step."""
        return self.source not in (InputSource.SHIFTED, InputSource.BACKUP)


# What a rung returns: its input or None, and what to report: of a failure why.
Rung = tuple[SelectedInput | None, str]


@dataclass(frozen=True, eq=False)
class InputSelector:
    """Makes the inputs of all rungs.

    Attributes:
        imposed: what a plan must meet; inputs are measured in its sizes.
        See ``MPC`` for all others.
    """

    ocp: OCP
    imposed: ImposedRows
    dt: float
    applied: PlantInput
    tolerance: float

    def of_plan(self, plan: Solution, now: Instant, source: InputSource) -> Rung:
        """Take the input that a plan has now."""
        # A control that moves is held at its value in the middle of the interval, its mean but
        # for second-order terms.
        middle = 0.0 if plan.control_kind == "held" else 0.5 * self.dt
        u = plan_controls(plan, now.t + middle)
        rates = self.ocp.control_rates
        if len(rates) and not self.ocp.model.is_discrete:
            # Where the next plan begins: it may change by the whole rate in an interval.
            u = u.copy()
            u[rates.index] = plan_controls(plan, now.t + self.dt)[rates.index]
        return self.bounded(self._input_map(now.x, u, now.t, now.p), source, now, plan)

    def bounded(
        self, given: np.ndarray, source: InputSource, now: Instant, plan: Solution | None = None
    ) -> Rung:
        """Move an input into its limits; None if it is not finite, or a plan's and moved far."""
        inside = self._limits.nearest(given, now)
        if inside is given:
            return SelectedInput(source, given.copy(), 0.0, plan), ""
        # Not finite where the input is not.
        excess = float((np.abs(given - inside) / self._sizes).max(initial=0.0))
        if not isfinite(excess):
            return None, f"the input {given} is not finite"
        # One that moves is held at its mean, which a limit that moves may exclude by a little.
        is_held = plan is not None and plan.control_kind == "held"
        if is_held and excess > self.tolerance:
            return None, f"the input {given} leaves its bounds by {excess:.3g}"
        return SelectedInput(source, inside, excess, plan), self._limits.exceeded(inside, now)

    @cached_property
    def _sizes(self) -> np.ndarray:
        """What the input is measured in, (m,)."""
        sizes = self.imposed.sizes if self.applied.what == "control" else None
        return np.ones(self.applied.size(self.ocp)) if sizes is None else sizes.controls

    @cached_property
    def _input_map(self) -> InputMap:
        return self.applied.sending(self.ocp)

    @cached_property
    def _limits(self) -> InputLimits:
        return InputLimits(self.ocp, self.applied, self.dt)

    def prepare(self) -> None:
        """Build what a step may need, so that no step waits for it."""
        self._limits.prepare()
