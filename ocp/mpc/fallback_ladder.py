"""One control step: collect inputs, solve, check, select the first rung that holds, report."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_numeric, check_real
from ocp.checks.errors import ProblemError
from ocp.closed_loop.decision import Decision, InputSource, StepReport
from ocp.closed_loop.guarded_call import CALLBACK_ERRORS
from ocp.mpc.backup_selection import Backup
from ocp.mpc.controller_state import ControllerState
from ocp.mpc.plan_check import HorizonParameters, PlanCheck
from ocp.mpc.plant_input import InputBounds, InputMap, PlantInput
from ocp.problem.ocp import OCP
from ocp.solution.shifted_plan import ShiftedPlan, plan_controls
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess, Program
from ocp.solution.status import Status

# t [s] -> parameters and signals of the horizon that starts there, by name.
Parameters = Callable[[float], Mapping[str, ArrayLike]]


class StepInputs(NamedTuple):
    """The data of one control step.

    Attributes:
        t: when the state was measured [s].
        applies_at: when the input acts [s].
        start: the state then (nx,), predicted where need be.
        is_measured: False where the measurement is missing; the last plan's state is used
            instead, if there is a plan.
        parameters: of the horizon from ``applies_at`` on.
        unknown: why they are those of the last plan, as far as they reach; empty where known.
    """

    t: float
    applies_at: float
    start: np.ndarray
    is_measured: bool
    parameters: HorizonParameters
    unknown: str

    @property
    def is_solvable(self) -> bool:
        """Whether the solver has what it needs."""
        return self.is_measured and not self.unknown


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


# What a rung returns: its input or None, and what to report: of a failure why.
Rung = tuple[SelectedInput | None, str]


@dataclass(frozen=True, eq=False, kw_only=True)
class FallbackLadder:
    """A controller that is built: what it knows from earlier steps is given to each step.

    Attributes:
        program: solves the problem.
        See ``MPC`` for all others.
    """

    ocp: OCP
    program: Program
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
        """Return what was decided, and what is known afterwards; see ``MPC.step``.

        The report is a ``Decision`` unless no rung holds.
        """
        started = perf_counter()
        inputs = self._collect(state, x, t, parameters)
        plan, status, reason = self._solve(inputs, state)
        used = perf_counter() - started
        is_late = plan is not None and (used > self.budget if late is None else late)

        reasons = [inputs.unknown, reason]
        selected, is_new = None, False
        if is_late:
            reasons.append(f"the answer came after {used:.3g} s, too late for its step")
        elif plan is not None:
            best = InputSource.OPTIMAL if status is Status.SOLVED else InputSource.FEASIBLE
            selected, reason = self._follow(plan, inputs, best)
            reasons.append(reason)
            is_new = selected is not None
        if selected is None:
            selected, reason = self._follow_shifted(state.plan, inputs)
            reasons.append(reason)
        if selected is None:
            selected, reason = self._back_up(inputs, state.last_input)
            reasons.append(reason)

        given = None if selected is None else selected.input
        new_plan = plan if is_late or is_new else None
        after = state.after(given, new_plan, solver_ran=inputs.is_solvable)
        message, known = "; ".join(filter(None, reasons)), not inputs.unknown
        if selected is None:
            report = StepReport(
                t=inputs.t,
                applies_at=inputs.applies_at,
                status=status,
                message=message,
                residual=plan.residual if plan else np.inf,
                late=is_late,
                parameters=inputs.parameters.by_name if known else {},
                parameters_known=known,
                new_plan=new_plan,
                time_used=perf_counter() - started,
            )
            return report, after
        source, given, clipped, followed = selected
        made_at = inputs.applies_at if is_new or followed is None else followed.t[0]
        decision = Decision(
            t=inputs.t,
            applies_at=inputs.applies_at,
            status=status,
            message=message,
            residual=plan.residual if plan else np.inf,
            late=is_late,
            parameters=inputs.parameters.by_name if known else {},
            parameters_known=known,
            new_plan=new_plan,
            time_used=perf_counter() - started,
            input=given,
            source=source,
            plan=followed,
            age=round((inputs.applies_at - made_at) / self.dt),
            clipped=clipped,
        )
        return decision, after

    # -- collect -----------------------------------------------------------------------------

    def _collect(
        self,
        state: ControllerState,
        x: ArrayLike,
        t: float,
        parameters: Mapping[str, ArrayLike] | None,
    ) -> StepInputs:
        """Check the measurement, get the parameters, and predict the state over the delay."""
        name, nx, plan = self.ocp.name, self.ocp.model.nx, state.plan
        applies_at = check_real(t, f"MPC of {name}: t [s]") + self.delay
        start = check_numeric(x, f"MPC of {name}: x")
        if start.shape != (nx,):
            raise ProblemError(f"MPC of {name}: x has shape {start.shape}, ({nx},) is needed")
        p, unknown = self._horizon_parameters(state, applies_at, parameters)
        is_measured = all(map(isfinite, start.tolist()))
        if not is_measured:  # without a plan the backup law sees what was measured
            start = start if plan is None else plan.state(applies_at)
        elif self.compensate and state.pending:
            at_effect = p.at(applies_at)
            for k, given in enumerate(state.pending):
                start = self._next_state(start, given, t + k * self.dt, at_effect)
        return StepInputs(float(t), applies_at, start, is_measured, p, unknown)

    def _horizon_parameters(
        self, state: ControllerState, t: float, given: Mapping[str, ArrayLike] | None
    ) -> tuple[HorizonParameters, str]:
        """Return the parameters of a horizon from t [s] on, or those of the last plan and why."""
        start, unknown = t, ""
        if given is not None or self.parameters is None:
            values = self.ocp.parameter_values(given)
        else:
            try:
                values = self.ocp.parameter_values(self.parameters(t))
            except CALLBACK_ERRORS as error:
                if state.input is None:  # the plant has not moved yet: let it be corrected
                    raise
                unknown = f"no parameters from t = {t:g} s on: {error}"
                start, known = (state.plan.t[0], state.plan.parameters) if state.plan else (t, None)
                values = self.ocp.parameter_values(known)
        by_name = values.as_dict() if values.entries else {}
        return HorizonParameters(values, by_name, start, self._duration), unknown

    def _next_state(self, x: np.ndarray, given: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
        """Return the model's state one interval after t [s] under an input, parameters held."""
        if self.applied.what == "rate":
            return x + self.dt * given
        return self._check.next_state(x, given, t, p)

    # -- solve and check ---------------------------------------------------------------------

    def _solve(
        self, inputs: StepInputs, state: ControllerState
    ) -> tuple[Solution | None, Status | None, str]:
        """Return a new plan that meets the constraints, how the solver ended, and a reason."""
        if not inputs.is_solvable:
            return None, None, "" if inputs.is_measured else "the measurement is not finite"
        start, t, p = inputs.start, inputs.applies_at, inputs.parameters
        last = None if state.cold_start else state.plan
        guess = ShiftedPlan(last, t) if last else self.guess
        try:
            plan = self.program.run(x0=start, t0=t, parameters=p.by_name, guess=guess)
        except CALLBACK_ERRORS as error:
            return None, None, f"{type(error).__name__} inside the solver: {error}"
        excess, worst = self._check.new_plan(plan, start, t, p)
        if excess > self.tolerance:
            return None, plan.status, f"{plan.status.name}: {plan.message or worst}"
        if plan.status is Status.SOLVED:
            return plan, plan.status, ""
        reason = f"{plan.status.name}: {plan.message or plan.status.value}"
        return plan, plan.status, reason

    # -- the rungs ---------------------------------------------------------------------------

    def _follow_shifted(self, plan: Solution | None, inputs: StepInputs) -> Rung:
        """Follow the last good plan, if its remainder meets the constraints."""
        if plan is None:
            return None, "there is no earlier plan"
        start, t, p = inputs.start, inputs.applies_at, inputs.parameters
        excess, worst = self._check.remainder(plan, start, t, p)
        if excess > self.tolerance:
            return None, f"the earlier plan: {worst}"
        return self._follow(plan, inputs, InputSource.SHIFTED)

    def _back_up(self, inputs: StepInputs, last: np.ndarray | None) -> Rung:
        """Take the input of the backup law, or the last one where it may be held."""
        t, size = inputs.applies_at, self.applied.size(self.ocp)
        p = inputs.parameters.at(t)
        given, reason = self.backup.input(inputs.start, t, p, size=size, last=last)
        if given is None:
            return None, reason
        selected, problem = self._bounded(given, InputSource.BACKUP)
        return selected, "; ".join(filter(None, (reason, problem)))

    def _follow(self, plan: Solution, inputs: StepInputs, source: InputSource) -> Rung:
        """Return the input that a plan has for this step."""
        # A control that moves is held at its value in the middle of the interval, its mean but
        # for second-order terms.
        t, middle = inputs.applies_at, 0.0 if plan.control_kind == "held" else 0.5 * self.dt
        u, p = plan_controls(plan, t + middle), inputs.parameters.at(t)
        return self._bounded(self._input_map(inputs.start, u, t, p), source, plan)

    def _bounded(
        self, given: np.ndarray, source: InputSource, plan: Solution | None = None
    ) -> Rung:
        """Clip an input; None if it is not finite, or a plan's that is clipped by too much."""
        inside, excess = self._bounds.clip(given)
        if not isfinite(excess):
            return None, f"the input {given} is not finite"
        if plan is not None and excess > self.tolerance:
            return None, f"the input {given} leaves its bounds by {excess:.3g}"
        return SelectedInput(source, inside, excess, plan), ""

    @cached_property
    def _duration(self) -> float:
        return self.ocp.duration

    @cached_property
    def _check(self) -> PlanCheck:
        return PlanCheck(self.ocp, self.dt, self.compiled)

    @cached_property
    def _input_map(self) -> InputMap:
        return self.applied.sending(self.ocp)

    @cached_property
    def _bounds(self) -> InputBounds:
        return InputBounds.of(self.applied.box(self.ocp))
