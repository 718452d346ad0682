"""From a measurement to an input that somebody answers for: the rungs, best first."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np

from ocp.closed_loop.decision import ControlRefused, InputSource
from ocp.closed_loop.guarded_call import CALLBACK_ERRORS, guarded_call
from ocp.closed_loop.shifted_plan import ShiftedPlan, plan_controls
from ocp.mpc.backup_selection import Backup, BackupFunction
from ocp.mpc.plan_check import PlanCheck
from ocp.mpc.plant_input import InputMap, PlantInput
from ocp.mpc.step_inputs import StepInputs
from ocp.problem.constraint import Box
from ocp.problem.ocp import OCP
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess, Program
from ocp.solution.status import Status


@dataclass(slots=True, eq=False)
class SelectedInput:
    """An input that a rung answers for; not frozen, as a ``StepInputs``.

    Attributes:
        outcome: which rung.
        input: within its bounds (m,).
        clipped: by how much it was moved to lie there.
        plan: that it comes from; None for the backup law.
    """

    outcome: InputSource
    input: np.ndarray
    clipped: float
    plan: Solution | None


@dataclass(frozen=True, eq=False, kw_only=True)
class FallbackLadder:
    """The rungs of one controller; each returns a choice, or None and a reason.

    Attributes:
        ocp: the problem.
        program: solves it.
        applied: what the plant receives.
        guess: where the first step starts.
        backup: the law of the last rung.
        dt: sampling interval [s].
        tolerance: what still counts as inside.
        compiled: whether the model runs as machine code.
    """

    ocp: OCP
    program: Program
    applied: PlantInput
    guess: InitialGuess | None
    backup: Backup
    dt: float
    tolerance: float
    compiled: bool

    def solve(self, moment: StepInputs) -> tuple[Solution | None, Status | None]:
        """Return a new plan that meets the constraints, and how the solver ended."""
        if not moment.is_measured:
            moment.reasons.append("the measurement is not finite")
        if not moment.is_solvable:
            return None, None
        last = None if moment.cold_start else moment.plan
        try:
            plan = self.program.run(
                x0=moment.start,
                t0=moment.at,
                parameters=moment.parameters,
                guess=ShiftedPlan(last, moment.at) if last else self.guess,
            )
        except CALLBACK_ERRORS as error:
            moment.reasons.append(f"{type(error).__name__} inside the solver: {error}")
            return None, None
        excess, worst = self._foresight.excess(plan, moment)
        if excess > self.tolerance:
            moment.reasons.append(f"{plan.status.name}: {plan.message or worst}")
            return None, plan.status
        if plan.status is not Status.SOLVED:
            moment.reasons.append(f"{plan.status.name}: {plan.message or plan.status.value}")
        return plan, plan.status

    def new(self, moment: StepInputs, plan: Solution) -> SelectedInput | None:
        """Follow the new plan."""
        outcome = InputSource.OPTIMAL if plan.status is Status.SOLVED else InputSource.FEASIBLE
        return self._following(plan, moment, outcome)

    def shifted(self, moment: StepInputs) -> SelectedInput | None:
        """Follow the last good plan, if its remainder meets the constraints."""
        if moment.plan is None:
            moment.reasons.append("there is no earlier plan")
            return None
        excess, worst = self._foresight.remaining(moment.plan, moment)
        if excess > self.tolerance:
            moment.reasons.append(f"the earlier plan: {worst}")
            return None
        return self._following(moment.plan, moment, InputSource.SHIFTED)

    def backed_up(self, moment: StepInputs, last: np.ndarray | None) -> SelectedInput | None:
        """Ask the backup law; where it holds and has no answer, hold the last input."""
        choice = self._by_law(moment, self.backup.law) if self.backup.law else None
        if choice or not self.backup.holds:
            if self.backup.law is None:
                moment.reasons.append("there is no backup law")
            return choice
        if last is None:
            moment.reasons.append("there is no input to hold")
            return None
        moment.reasons.append("backup: hold")
        return self._within(moment, last, InputSource.BACKUP)

    def _by_law(self, moment: StepInputs, law: BackupFunction) -> SelectedInput | None:
        """Ask the backup law."""
        p = self._foresight.parameters(moment, moment.at)
        try:
            given = guarded_call(
                lambda x, t: law(x, t, p), "the backup law", moment.start, moment.at
            )
        except ControlRefused as refusal:
            moment.reasons.append(str(refusal))
            return None
        needed = self.applied.size(self.ocp)
        if len(given) != needed:
            moment.reasons.append(f"the backup law returned {len(given)} numbers, not {needed}")
            return None
        choice = self._within(moment, given, InputSource.BACKUP)
        if choice:
            moment.reasons.append(f"backup: {self.backup.name}")
        return choice

    def advanced(self, x: np.ndarray, given: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
        """Return the model's state one interval after t [s] under an input, parameters held."""
        if self.applied.what == "rate":
            return x + self.dt * given
        return self._foresight.advanced(x, given, t, p)

    # -- pieces -------------------------------------------------------------------------------

    def _following(
        self, plan: Solution, moment: StepInputs, outcome: InputSource
    ) -> SelectedInput | None:
        """Follow a plan now; None where its input is none."""
        # A control that moves is held at its value in the middle of the interval, its mean but
        # for second-order terms.
        middle = 0.0 if plan.control_kind == "held" else 0.5 * self.dt
        u, p = (
            plan_controls(plan, moment.at + middle),
            self._foresight.parameters(moment, moment.at),
        )
        given = self._sending(moment.start, u, moment.at, p)
        return self._within(moment, given, outcome, plan)

    def _within(
        self,
        moment: StepInputs,
        given: np.ndarray,
        outcome: InputSource,
        plan: Solution | None = None,
    ) -> SelectedInput | None:
        """Clip an input; None if it is not finite, or a plan's that is clipped by too much."""
        # Nearly all inputs need no clipping, and plain numbers say so sooner than numpy does.
        each = zip(given.tolist(), *self._limits, strict=True)
        if all([low <= value <= high for value, low, high in each]):
            return SelectedInput(outcome, given.copy(), 0.0, plan)
        inside = self.box.clip(given)
        # Where an input is not finite, nor is this.
        excess = float(np.abs(given - inside).max())
        if not isfinite(excess):
            moment.reasons.append(f"the input {given} is not finite")
            return None
        if plan is not None and excess > self.tolerance:
            moment.reasons.append(f"the input {given} leaves its bounds by {excess:.3g}")
            return None
        return SelectedInput(outcome, inside, excess, plan)

    @cached_property
    def _foresight(self) -> PlanCheck:
        """What a plan would do."""
        return PlanCheck(self.ocp, self.dt, self.compiled)

    @cached_property
    def _limits(self) -> tuple[list[float], list[float]]:
        """The bounds of the input as plain numbers, finite where there are none: inf is outside."""
        largest = np.finfo(float).max
        lower, upper = (
            np.clip(side, -largest, largest) for side in (self.box.lower, self.box.upper)
        )
        return lower.tolist(), upper.tolist()

    @cached_property
    def _sending(self) -> InputMap:
        """What makes an input of a state and a control."""
        return self.applied.sending(self.ocp)

    @cached_property
    def box(self) -> Box:
        """Bounds of the input, each (m,)."""
        return self.applied.box(self.ocp)
