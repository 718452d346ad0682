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
from ocp.mpc.input_limits import InputLimits, Instant
from ocp.mpc.plan_check import HorizonParameters, PlanCheck
from ocp.mpc.plant_input import InputMap, PlantInput
from ocp.problem.constraint_rows import ProblemRows
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
        start: the state then (nx,), predicted where need be; of the last plan where nothing is
            measured and there is a plan.
        parameters: of the horizon from ``applies_at`` on.
        parameters_known: False where they are those of the last plan, as far as they reach.
        unsolvable: why the solver cannot be run; empty where it can.
    """

    t: float
    applies_at: float
    start: np.ndarray
    parameters: HorizonParameters
    parameters_known: bool
    unsolvable: str


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
        program: the built solver.
        duration: of the horizon [s].
        rows: what a plan must meet: the rows that the solver was given.
        See ``MPC`` for all others.
    """

    ocp: OCP
    program: Program
    duration: float
    rows: ProblemRows
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
        inputs = self._collect(state, x, t, parameters)
        measured_at, applies_at, start, p, known, unsolvable = inputs
        plan, status, message = self._solve(inputs, state)
        used = perf_counter() - started
        is_late = plan is not None and (used > self.budget if late is None else late)

        selected, is_new = None, False
        if is_late:
            too_late = f"the answer came after {used:.3g} s, too late for its step"
            message = _joined(message, too_late)
        elif plan is not None:
            best = InputSource.OPTIMAL if status is Status.SOLVED else InputSource.FEASIBLE
            selected, reason = self._follow(plan, start, applies_at, p, best)
            message = _joined(message, reason)
            is_new = selected is not None
        if selected is None:
            selected, reason = self._follow_shifted(state.plan, start, applies_at, p)
            message = _joined(message, reason)
        if selected is None:
            selected, reason = self._back_up(state.last_input, start, applies_at, p)
            message = _joined(message, reason)

        given = None if selected is None else selected.input
        new_plan = plan if is_late or is_new else None
        after = state.after(given, new_plan, solver_ran=not unsolvable)
        residual = plan.residual if plan else np.inf
        if selected is None:
            report = StepReport(
                t=measured_at,
                applies_at=applies_at,
                status=status,
                message=message,
                residual=residual,
                late=is_late,
                parameters=p.by_name if known else {},
                parameters_known=known,
                new_plan=new_plan,
                time_used=perf_counter() - started,
            )
            return report, after
        source, given, clipped, followed = selected
        made_at = applies_at if is_new or followed is None else followed.t[0]
        decision = Decision(
            t=measured_at,
            applies_at=applies_at,
            status=status,
            message=message,
            residual=residual,
            late=is_late,
            parameters=p.by_name if known else {},
            parameters_known=known,
            new_plan=new_plan,
            time_used=perf_counter() - started,
            input=given,
            source=source,
            plan=followed,
            age=round((applies_at - made_at) / self.dt),
            clipped=clipped,
        )
        return decision, after

    def _collect(
        self, state: ControllerState, x: ArrayLike, t: float, given: Mapping[str, ArrayLike] | None
    ) -> StepInputs:
        """Check the measurement, get the parameters, and predict the state over the delay."""
        name, nx, plan = self.ocp.name, self.ocp.model.nx, state.plan
        applies_at = check_real(t, f"MPC of {name}: t [s]") + self.delay
        start = check_numeric(x, f"MPC of {name}: x")
        if start.shape != (nx,):
            raise ProblemError(f"MPC of {name}: x has shape {start.shape}, ({nx},) is needed")
        p, unknown = self._horizon_parameters(state, applies_at, given)
        is_measured = all(map(isfinite, start.tolist()))
        if not is_measured:  # without a plan the backup law sees what was measured
            start = start if plan is None else plan.state(applies_at)
        elif self.compensate and state.pending:
            at_effect = p.at(applies_at)
            for k, sent in enumerate(state.pending):
                start = self._next_state(start, sent, t + k * self.dt, at_effect)
        unsolvable = unknown if is_measured else _joined(unknown, "the measurement is not finite")
        return StepInputs(float(t), applies_at, start, p, not unknown, unsolvable)

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
        return HorizonParameters(values, by_name, start, self.duration), unknown

    def _next_state(self, x: np.ndarray, given: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
        """Return the model's state one interval after t [s] under an input, parameters held."""
        if self.applied.what == "rate":
            return x + self.dt * given
        return self._check.next_state(x, given, t, p)

    def _solve(
        self, inputs: StepInputs, state: ControllerState
    ) -> tuple[Solution | None, Status | None, str]:
        """Return a new plan that meets the constraints, how the solver ended, and a reason."""
        _, t, start, p, _, unsolvable = inputs
        if unsolvable:
            return None, None, unsolvable
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

    def _follow_shifted(
        self, plan: Solution | None, start: np.ndarray, t: float, p: HorizonParameters
    ) -> Rung:
        """Follow the last good plan, if its remainder meets the constraints."""
        if plan is None:
            return None, "there is no earlier plan"
        excess, worst = self._check.remainder(plan, start, t, p)
        if excess > self.tolerance:
            return None, f"the earlier plan: {worst}"
        return self._follow(plan, start, t, p, InputSource.SHIFTED)

    def _back_up(
        self, last: np.ndarray | None, start: np.ndarray, t: float, p: HorizonParameters
    ) -> Rung:
        """Take the input of the backup law, or the last one where it may be held."""
        size, now = self.applied.size(self.ocp), Instant(start, t, p.at(t))
        if self.ocp.model.u_is_change:  # to hold is to change nothing
            last = np.zeros(size)
        given, reason = self.backup.input(*now, size=size, last=last)
        if given is None:
            return None, reason
        selected, problem = self._bounded(given, InputSource.BACKUP, now)
        return selected, _joined(reason, problem)

    def _follow(
        self, plan: Solution, x: np.ndarray, t: float, p: HorizonParameters, source: InputSource
    ) -> Rung:
        """Take the input that a plan has at t [s]."""
        # A control that moves is held at its value in the middle of the interval, its mean but
        # for second-order terms.
        middle = 0.0 if plan.control_kind == "held" else 0.5 * self.dt
        u, now = plan_controls(plan, t + middle), Instant(x, t, p.at(t))
        return self._bounded(self._input_map(x, u, t, now.p), source, now, plan)

    def _bounded(
        self, given: np.ndarray, source: InputSource, now: Instant, plan: Solution | None = None
    ) -> Rung:
        """Move an input into its limits; None if it is not finite, or a plan's and moved far."""
        inside = self._input_limits.nearest(given, now)
        excess = float(np.abs(given - inside).max())  # not finite where the input is not
        if not isfinite(excess):
            return None, f"the input {given} is not finite"
        if plan is not None and excess > self.tolerance:
            return None, f"the input {given} leaves its bounds by {excess:.3g}"
        return SelectedInput(source, inside, excess, plan), ""

    @cached_property
    def _check(self) -> PlanCheck:
        return PlanCheck(self.ocp, self.dt, self.compiled, self.rows)

    @cached_property
    def _input_map(self) -> InputMap:
        return self.applied.sending(self.ocp)

    @cached_property
    def _input_limits(self) -> InputLimits:
        return InputLimits(self.ocp, self.applied)


def _joined(said: str, more: str) -> str:
    return f"{said}; {more}" if said and more else said or more
