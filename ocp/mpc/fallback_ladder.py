"""One control step: solve, check, select the first rung that holds, report."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ocp.closed_loop.decision import Decision, InputSource, StepReport
from ocp.mpc.backup_selection import Backup
from ocp.mpc.controller_state import ControllerState
from ocp.mpc.input_limits import Instant
from ocp.mpc.plan_check import ROUNDING, HorizonParameters, PlanCheck
from ocp.mpc.plant_input import PlantInput
from ocp.mpc.selected_input import InputSelector, Rung, SelectedInput
from ocp.mpc.step_clock import StepClock
from ocp.mpc.step_inputs import InputCollector, Parameters, StepInputs, joined
from ocp.mpc.step_solver import SolvedStep, StepSolver, refusal
from ocp.problem.constraint_rows import ImposedRows
from ocp.problem.ocp import OCP
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess, Program
from ocp.solution.status import Status


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
    real_time: bool

    def step(
        self,
        state: ControllerState,
        x: ArrayLike,
        t: float,
        *,
        late: bool | None,
        parameters: Mapping[str, ArrayLike] | None,
        started: float,
        broken: str,
    ) -> tuple[StepReport, ControllerState]:
        """Return a ``Decision``, or a report where no rung holds, and what is known afterwards.

        Args:
            state: what is known from earlier steps.
            x: measured state (nx,).
            t: when it was measured [s].
            late: whether the step's time is over; None: by the clock.
            parameters: of the horizon; None: what the controller's own say.
            started: when the step began, of ``perf_counter`` [s].
            broken: why the solver could not be built again; empty where it is whole.
        """
        inputs = self._inputs.collect(state, x, t, parameters)
        solver_ran = not inputs.unsolvable
        if broken:
            inputs = inputs._replace(unsolvable=joined(inputs.unsolvable, broken))
        solved = self._solver.solve(inputs, state)
        clock = StepClock(started, self.budget, late)
        selected, reason = self._descend(inputs, state, solved, clock)
        is_late = clock.late
        given = None if selected is None else selected.input
        new_plan = solved.plan if is_late else None
        if selected is not None and selected.is_new:
            new_plan = selected.plan
        meets = selected is None or selected.source is not InputSource.LEAST_VIOLATING
        after = state.after(
            given,
            new_plan,
            solver_ran=solver_ran,
            meets_constraints=meets,
            solver_raised=solved.raised or bool(broken),
            seen=inputs.seen,
        )
        report = self._report(
            inputs, solved, selected, reason, new_plan=new_plan, late=is_late, started=started
        )
        return report, after

    def _report(
        self,
        inputs: StepInputs,
        solved: SolvedStep,
        selected: SelectedInput | None,
        reason: str,
        *,
        new_plan: Solution | None,
        late: bool,
        started: float,
    ) -> StepReport:
        """Return what a step came to: a ``Decision`` where a rung holds."""
        # One object is made of it, not two: each costs a step a dozen frozen fields.
        report: dict[str, Any] = dict(
            t=inputs.t,
            applies_at=inputs.applies_at,
            status=solved.status,
            message=joined(solved.message, reason),
            residual=solved.plan.residual if solved.plan else np.inf,
            late=late,
            parameters=inputs.parameters.by_name if inputs.parameters_known else {},
            parameters_known=inputs.parameters_known,
            new_plan=new_plan,
            time_used=perf_counter() - started,
        )
        if selected is None:
            return StepReport(**report)
        return Decision(
            **report,
            input=selected.input,
            source=selected.source,
            plan=selected.plan,
            age=self._age(selected, inputs.applies_at),
            clipped=selected.clipped,
        )

    def _age(self, selected: SelectedInput, now: float) -> int:
        """Return how many steps ago the plan of an input was made."""
        if selected.is_new or selected.plan is None:
            return 0
        return round((now - selected.plan.t.item(0)) / self.dt)

    def _descend(
        self, inputs: StepInputs, state: ControllerState, solved: SolvedStep, clock: StepClock
    ) -> Rung:
        """Return the first rung that holds, and why those before it do not."""
        now, why = Instant(inputs.start, inputs.applies_at, inputs.now), ""
        if clock.is_over():
            why = clock.said if solved.plan is not None else ""
        elif solved.plan is not None:
            selected, why = self._selector.of_plan(solved.plan, now, _source_of(solved))
            if selected is not None:
                return selected, why
        selected, reason = self._follow_shifted(state.plan, now, inputs.parameters)
        why = joined(why, reason)
        may_violate = self.least is not None and not inputs.unsolvable
        if selected is None and may_violate and not clock.is_over():
            selected, reason = self._violate_least(inputs, state, solved, now)
            if clock.is_over():
                selected, reason = None, f"the least violating plan: {clock.said}"
            why = joined(why, reason)
        if selected is None and state.plan is not None:  # without a better one, past its end
            selected, _ = self._follow_shifted(state.plan, now, inputs.parameters, to_its_end=False)
        if selected is None:
            selected, reason = self._back_up(state.last_input, now)
            why = joined(why, reason)
        return selected, why

    # -- the rungs ---------------------------------------------------------------------------

    def _follow_shifted(
        self,
        plan: Solution | None,
        now: Instant,
        p: HorizonParameters,
        *,
        to_its_end: bool = True,
    ) -> Rung:
        """Follow the last good plan, if its remainder meets the constraints."""
        if plan is None:
            return None, "there is no earlier plan"
        if now.t < plan.t[0] - ROUNDING * self.dt:
            return None, f"time went back to {now.t:.6g} s, the plan begins at {plan.t[0]:.6g} s"
        excess, worst = self._check.remainder(plan, now.x, now.t, p, to_its_end=to_its_end)
        if excess > self.tolerance:
            return None, f"the earlier plan: {worst}"
        return self._selector.of_plan(plan, now, InputSource.SHIFTED)

    def _violate_least(
        self, inputs: StepInputs, state: ControllerState, solved: SolvedStep, now: Instant
    ) -> Rung:
        """Follow the plan that violates the constraints on states least; say by how much.

        That of the solver itself, which nearly met them, may be better than the one at a price.
        """
        found, why = self._solver.least_violating(inputs, state)
        candidates = [plan for plan in (found, solved.rejected) if plan is not None]
        p, best = inputs.parameters, None
        for plan in candidates:
            violation = self._check.violation(plan, now.x, now.t, p)
            if violation.of_inputs > self.tolerance:
                if plan is found:
                    why = f"no least violating plan: {refusal(plan, violation.worst)}"
            elif best is None or violation.largest < best[1].largest:
                best = plan, violation
        if best is None:
            return None, why
        plan, violation = best
        if violation.largest <= self.tolerance:
            selected, reason = self._selector.of_plan(plan, now, InputSource.FEASIBLE)
            return selected, reason or "another plan meets the constraints"
        selected, reason = self._selector.of_plan(plan, now, InputSource.LEAST_VIOLATING)
        return selected, reason or f"no plan meets the constraints; {violation.worst}"

    def _back_up(self, last: np.ndarray | None, now: Instant) -> Rung:
        """Take the input of the backup law, or the last one where it may be held."""
        size = self.applied.size(self.ocp)
        if last is None and len(self.ocp.control_rates) == size:  # it is declared
            last = np.asarray(self.ocp.last_input)
        given, reason = self.backup.input(*now, size=size, last=last)
        if given is None:
            return None, reason
        selected, problem = self._selector.bounded(given, InputSource.BACKUP, now)
        return selected, joined(reason, problem)

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
    def _solver(self) -> StepSolver:
        return StepSolver(
            ocp=self.ocp,
            program=self.program,
            least=self.least,
            check=self._check,
            guess=self.guess,
            tolerance=self.tolerance,
            real_time=self.real_time,
        )

    @cached_property
    def _check(self) -> PlanCheck:
        return PlanCheck(self.ocp, self.dt, self.compiled, self.imposed)

    @cached_property
    def _selector(self) -> InputSelector:
        return InputSelector(self.ocp, self.imposed, self.dt, self.applied, self.tolerance)

    def prepare(self) -> None:
        """Build what a step may need, so that no step waits for it."""
        self._selector.prepare()

    def prepare_step(
        self, state: ControllerState, parameters: Mapping[str, ArrayLike] | None
    ) -> bool:
        """Prepare the plan of the next step, see ``MPC``; return whether there is one."""
        expected = self._inputs.expected(state, parameters)
        return expected is not None and self._solver.prepare(expected, state)


def _source_of(solved: SolvedStep) -> InputSource:
    """Return what a new plan is."""
    if solved.is_corrected:
        return InputSource.REAL_TIME
    return InputSource.OPTIMAL if solved.status is Status.SOLVED else InputSource.FEASIBLE
