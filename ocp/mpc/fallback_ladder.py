"""One control step: solve, check, select the first rung that holds, report."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import class_in_words
from ocp.checks.errors import ProblemError
from ocp.closed_loop.decision import Decision, InputSource, StepReport
from ocp.closed_loop.guarded_call import CALLBACK_ERRORS
from ocp.mpc.backup_selection import Backup
from ocp.mpc.controller_state import ControllerState
from ocp.mpc.input_limits import InputLimits, Instant
from ocp.mpc.plan_check import HorizonParameters, PlanCheck
from ocp.mpc.plant_input import InputMap, PlantInput
from ocp.mpc.step_inputs import InputCollector, Parameters, StepInputs, joined
from ocp.problem.constraint_rows import ImposedRows
from ocp.problem.ocp import OCP
from ocp.problem.scaled import sizes_of
from ocp.solution.shifted_plan import ShiftedPlan, plan_controls
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess, Program
from ocp.solution.status import Status

# A plan whose state is further from the measured one, in sizes, is no start for the next.
_FAR = 100.0
_NOW = np.zeros(1)
# Of an instant, relative to the interval.
_ROUNDING = 1e-6


class SolvedStep(NamedTuple):
    """What the solver returned at one step.

    Attributes:
        plan: a new plan that meets the constraints, or None.
        status: how the solver ended; None where it was not run, or raised.
        message: why there is no plan, or it is not optimal.
        raised: whether the solver raised something, and is to be built again.
    """

    plan: Solution | None
    status: Status | None
    message: str
    raised: bool = False


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


@dataclass(frozen=True, eq=False, kw_only=True)
class FallbackLadder:
    """A controller that is built: what it knows from earlier steps is given to each step.

    Attributes:
        program: the built solver.
        least: finds the plan that violates the constraints least; None where nothing can be
            violated, or the solver knows no such plan.
        imposed: what a plan must meet: the rows that the solver was given, where it was.
        See ``MPC`` for all others.
    """

    ocp: OCP
    program: Program
    least: Program | None
    imposed: ImposedRows
    dt: float
    applied: PlantInput
    backup: Backup
    parameters: Parameters | None
    guess: InitialGuess | None
    delay: float
    compensate: bool
    budget: float
    tolerance: float
    compiled: bool

    def step(
        self,
        state: ControllerState,
        x: ArrayLike,
        t: float,
        *,
        late: bool | None,
        parameters: Mapping[str, ArrayLike] | None,
    ) -> tuple[StepReport, ControllerState]:
        """Return a ``Decision``, or a report where no rung holds, and what is known afterwards."""
        started = perf_counter()
        inputs = self._inputs.collect(state, x, t, parameters)
        solved = self._solve(inputs, state)
        used = perf_counter() - started
        is_late = solved.plan is not None and (used > self.budget if late is None else late)
        selected, reason = self._descend(inputs, state, solved, used if is_late else None)
        given = None if selected is None else selected.input
        new_plan = solved.plan if is_late else None
        if selected is not None and selected.is_new:
            new_plan = selected.plan
        meets = selected is None or selected.source is not InputSource.LEAST_VIOLATING
        after = state.after(
            given,
            new_plan,
            solver_ran=not inputs.unsolvable,
            meets_constraints=meets,
            solver_raised=solved.raised,
        )
        report = StepReport(
            t=inputs.t,
            applies_at=inputs.applies_at,
            status=solved.status,
            message=joined(solved.message, reason),
            residual=solved.plan.residual if solved.plan else np.inf,
            late=is_late,
            parameters=inputs.parameters.by_name if inputs.parameters_known else {},
            parameters_known=inputs.parameters_known,
            new_plan=new_plan,
            time_used=perf_counter() - started,
        )
        if selected is None:
            return report, after
        return self._decision(report, selected), after

    def _decision(self, report: StepReport, selected: SelectedInput) -> Decision:
        plan = selected.plan
        made_at = report.applies_at if selected.is_new or plan is None else plan.t[0]
        return Decision(
            **vars(report),
            input=selected.input,
            source=selected.source,
            plan=plan,
            age=round((report.applies_at - made_at) / self.dt),
            clipped=selected.clipped,
        )

    def _descend(
        self, inputs: StepInputs, state: ControllerState, solved: SolvedStep, late: float | None
    ) -> Rung:
        """Return the first rung that holds, and why those before it do not.

        Args:
            inputs: of the step.
            state: what is known from earlier ones.
            solved: what the solver returned.
            late: after how long its plan came, where that was too late for the step [s].
        """
        now, why = Instant(inputs.start, inputs.applies_at, inputs.now), ""
        if late is not None:
            why = f"the answer came after {late:.3g} s, too late for its step"
        elif solved.plan is not None:
            best = InputSource.OPTIMAL if solved.status is Status.SOLVED else InputSource.FEASIBLE
            selected, why = self._follow(solved.plan, now, best)
            if selected is not None:
                return selected, why
        selected, reason = self._follow_shifted(state.plan, now, inputs.parameters)
        why = joined(why, reason)
        if selected is None and late is None and not inputs.unsolvable and self.least is not None:
            selected, reason = self._violate_least(self.least, inputs, state, now)
            why = joined(why, reason)
        if selected is None:
            selected, reason = self._back_up(state.last_input, now)
            why = joined(why, reason)
        return selected, why

    def _solve(self, inputs: StepInputs, state: ControllerState) -> SolvedStep:
        """Run the solver, and check that its plan meets the constraints."""
        if inputs.unsolvable:
            return SolvedStep(None, None, inputs.unsolvable)
        start, t, p = inputs.start, inputs.applies_at, inputs.parameters
        guess = self._warm_start(state, start, t)
        try:
            plan = _plan_of(self.program, inputs, guess)
        except CALLBACK_ERRORS as error:
            said = f"{type(error).__name__} inside the solver: {error}"
            return SolvedStep(None, None, said, raised=True)
        excess, worst = self._check.new_plan(plan, start, t, p)
        if excess > self.tolerance:
            return SolvedStep(None, plan.status, f"{plan.status.name}: {plan.message or worst}")
        if plan.status is Status.SOLVED:
            return SolvedStep(plan, plan.status, "")
        reason = f"{plan.status.name}: {plan.message or plan.status.value}"
        return SolvedStep(plan, plan.status, reason)

    def _warm_start(
        self, state: ControllerState, start: np.ndarray, t: float
    ) -> InitialGuess | None:
        """Return the last plan moved to now, unless it is of no use; then where a loop begins."""
        last = state.plan
        if last is None or state.cold_start or t < last.t[0]:
            return self.guess
        shifted = ShiftedPlan(last, t)
        expected = shifted.sample("x", _NOW, len(start))[0]
        # A plan from a wrong measurement, or one that a jump of the state has overtaken.
        if (np.abs(expected - start) > _FAR * (self._sizes + np.abs(start))).any():
            return self.guess
        return shifted

    # -- the rungs ---------------------------------------------------------------------------

    def _follow_shifted(self, plan: Solution | None, now: Instant, p: HorizonParameters) -> Rung:
        """Follow the last good plan, if its remainder meets the constraints."""
        if plan is None:
            return None, "there is no earlier plan"
        if now.t < plan.t[0] - _ROUNDING * self.dt:
            return None, f"time went back to {now.t:.6g} s, the plan begins at {plan.t[0]:.6g} s"
        excess, worst = self._check.remainder(plan, now.x, now.t, p)
        if excess > self.tolerance:
            return None, f"the earlier plan: {worst}"
        return self._follow(plan, now, InputSource.SHIFTED)

    def _violate_least(
        self, least: Program, inputs: StepInputs, state: ControllerState, now: Instant
    ) -> Rung:
        """Follow the plan that violates the constraints on states least; say by how much."""
        p, guess = inputs.parameters, self._warm_start(state, now.x, now.t)
        try:
            plan = _plan_of(least, inputs, guess)
        except CALLBACK_ERRORS as error:
            return None, f"no least violating plan: {type(error).__name__}: {error}"
        excess, worst = self._check.least_violating(plan, now.x, now.t, p)
        if excess > self.tolerance:
            return None, f"no least violating plan: {plan.status.name}: {plan.message or worst}"
        selected, reason = self._follow(plan, now, InputSource.LEAST_VIOLATING)
        return (
            selected,
            reason or f"no plan meets the constraints; {worst or 'this one nearly does'}",
        )

    def _back_up(self, last: np.ndarray | None, now: Instant) -> Rung:
        """Take the input of the backup law, or the last one where it may be held."""
        size = self.applied.size(self.ocp)
        if self.ocp.model.u_is_change:  # to hold is to change nothing
            last = np.zeros(size)
        given, reason = self.backup.input(*now, size=size, last=last)
        if given is None:
            return None, reason
        selected, problem = self._bounded(given, InputSource.BACKUP, now)
        return selected, joined(reason, problem)

    def _follow(self, plan: Solution, now: Instant, source: InputSource) -> Rung:
        """Take the input that a plan has now."""
        # A control that moves is held at its value in the middle of the interval, its mean but
        # for second-order terms.
        middle = 0.0 if plan.control_kind == "held" else 0.5 * self.dt
        u = plan_controls(plan, now.t + middle)
        return self._bounded(self._input_map(now.x, u, now.t, now.p), source, now, plan)

    def _bounded(
        self, given: np.ndarray, source: InputSource, now: Instant, plan: Solution | None = None
    ) -> Rung:
        """Move an input into its limits; None if it is not finite, or a plan's and moved far."""
        inside = self._input_limits.nearest(given, now)
        excess = float(np.abs(given - inside).max())  # not finite where the input is not
        if not isfinite(excess):
            return None, f"the input {given} is not finite"
        # One that moves is held at its mean, which a limit that moves may exclude by a little.
        is_held = plan is not None and plan.control_kind == "held"
        if is_held and excess > self.tolerance:
            return None, f"the input {given} leaves its bounds by {excess:.3g}"
        return SelectedInput(source, inside, excess, plan), ""

    @cached_property
    def _inputs(self) -> InputCollector:
        return InputCollector(
            ocp=self.ocp,
            check=self._check,
            dt=self.dt,
            applied=self.applied,
            parameters=self.parameters,
            delay=self.delay,
            compensate=self.compensate,
        )

    @cached_property
    def _sizes(self) -> np.ndarray:
        return sizes_of(self.ocp).x

    @cached_property
    def _check(self) -> PlanCheck:
        return PlanCheck(self.ocp, self.dt, self.compiled, self.imposed)

    @cached_property
    def _input_map(self) -> InputMap:
        return self.applied.sending(self.ocp)

    @cached_property
    def _input_limits(self) -> InputLimits:
        return InputLimits(self.ocp, self.applied)


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
