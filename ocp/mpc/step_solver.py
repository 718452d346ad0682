"""The solver at one control step: where it starts, what it brought, and whether that is a plan."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ocp.checks.arguments import class_in_words
from ocp.checks.errors import ProblemError
from ocp.closed_loop.guarded_call import CALLBACK_ERRORS
from ocp.mpc.controller_state import ControllerState
from ocp.mpc.plan_check import PlanCheck
from ocp.mpc.step_inputs import StepInputs, joined
from ocp.problem.ocp import OCP
from ocp.problem.scaled import sizes_of
from ocp.solution.shifted_plan import ShiftedPlan
from ocp.solution.solution import Solution
from ocp.solution.solver import FeedbackProgram, InitialGuess, Program
from ocp.solution.status import Status

# A plan whose state is further from the measured one, in sizes, is no start for the next.
_FAR = 100.0


class SolvedStep(NamedTuple):
    """What the solver returned at one step.

    Attributes:
        plan: a new plan that meets the constraints, or None.
        status: how the solver ended; None where it was not run, or raised.
        message: why there is no plan, or it is not optimal.
        raised: whether the solver raised something, and is to be built again.
        rejected: a plan that does not meet the constraints.
        is_corrected: whether the plan is a prepared one, corrected by the measured state.
    """

    plan: Solution | None
    status: Status | None
    message: str
    raised: bool = False
    rejected: Solution | None = None
    is_corrected: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class StepSolver:
    """Runs the solver of a controller; see ``MPC`` for the options.

    Attributes:
        program: the built solver.
        least: finds the plan that violates the constraints least, or None.
        check: the controller's model.
        real_time: whether a plan that was prepared is corrected, before anything is solved.
    """

    ocp: OCP
    program: Program
    least: Program | None
    check: PlanCheck
    guess: InitialGuess | None
    tolerance: float
    real_time: bool

    def solve(self, inputs: StepInputs, state: ControllerState) -> SolvedStep:
        """Run the solver, and check that its plan meets the constraints."""
        if inputs.unsolvable:
            return SolvedStep(None, None, inputs.unsolvable)
        start, t, p = inputs.start, inputs.applies_at, inputs.parameters
        corrected = self._corrected(inputs) if self.real_time else None
        if corrected is not None:
            return corrected
        guess = self._warm_start(state, start, t)
        try:
            plan = _plan_of(self.program, inputs, guess)
        except CALLBACK_ERRORS as error:
            said = f"{type(error).__name__} inside the solver: {error}"
            return SolvedStep(None, None, said, raised=True)
        excess, worst = self.check.new_plan(plan, start, t, p)
        if excess > self.tolerance:
            return SolvedStep(None, plan.status, refusal(plan, worst), rejected=plan)
        if plan.status is Status.SOLVED:
            return SolvedStep(plan, plan.status, "")
        reason = f"{plan.status.name}: {plan.message or plan.status.value}"
        return SolvedStep(plan, plan.status, reason)

    def _corrected(self, inputs: StepInputs) -> SolvedStep | None:
        """Return the plan that was prepared, corrected by the measured state.

        None where there is none, or the model leaves its states or the constraints under it: a
        solve decides.
        """
        if not isinstance(self.program, FeedbackProgram):
            return None
        start, t, p = inputs.start, inputs.applies_at, inputs.parameters
        try:
            plan = self.program.feedback(x0=start, t0=t, parameters=p.by_name)
        except CALLBACK_ERRORS:
            return None
        if plan is None or self.check.corrected_plan(plan, start, t, p)[0] > self.tolerance:
            return None
        return SolvedStep(plan, plan.status, plan.message, is_corrected=True)

    def prepare(self, expected: StepInputs, state: ControllerState) -> bool:
        """Prepare a plan for a step that is expected; return whether there is one."""
        if expected.unsolvable or not isinstance(self.program, FeedbackProgram):
            return False
        start, t = expected.start, expected.applies_at
        try:
            return self.program.prepare_feedback(
                x0=start,
                t0=t,
                parameters=expected.parameters.by_name,
                guess=self._warm_start(state, start, t),
            )
        except CALLBACK_ERRORS:
            return False

    def _warm_start(
        self, state: ControllerState, start: np.ndarray, t: float
    ) -> InitialGuess | None:
        """Return the last plan moved to now, unless it is of no use; then where a loop begins."""
        last = state.plan
        if last is None or state.cold_start or t < last.t[0]:
            return self.guess
        # A plan from a wrong measurement, or one that a jump of the state has overtaken. Its node
        # before now is near enough for that, and plain numbers are quicker than numpy.
        expected = last.x[last.t.searchsorted(t, side="right") - 1].tolist()
        each = zip(expected, start.tolist(), self._sizes, strict=True)
        if all([abs(there - here) <= _FAR * (size + abs(here)) for there, here, size in each]):
            return ShiftedPlan(last, t)
        return self.guess

    def least_violating(
        self, inputs: StepInputs, state: ControllerState
    ) -> tuple[Solution | None, str]:
        """Return the plan that violates the constraints on states least, or None and why."""
        assert self.least is not None
        guess = self._warm_start(state, inputs.start, inputs.applies_at)
        try:
            return _plan_of(self.least, inputs, guess), ""
        except CALLBACK_ERRORS as error:
            return None, f"no least violating plan: {type(error).__name__}: {error}"

    @cached_property
    def _sizes(self) -> list[float]:
        return sizes_of(self.ocp).x.tolist()


def refusal(plan: Solution, why: str) -> str:
    """Return how a solver ended and what is wrong with its plan, in words."""
    said = plan.message if why == plan.status.value and plan.message else joined(plan.message, why)
    return f"{plan.status.name}: {said}"


def _plan_of(program: Program, inputs: StepInputs, guess: InitialGuess | None) -> Solution:
    """Run a program for a step; whatever it raises is for the caller.

    Raises:
        ProblemError: if it returns something else than a solution.
    """
    plan = program.run(
        x0=inputs.start,
        t0=inputs.applies_at,
        parameters=inputs.parameters.by_name,
        guess=guess,
    )
    if not isinstance(plan, Solution):
        raise ProblemError(f"it returned {class_in_words(plan)}, no solution")
    return plan
