"""The data of a control step: what was measured, and what is known of the horizon."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_numeric, check_real
from ocp.checks.errors import ProblemError
from ocp.closed_loop.guarded_call import CALLBACK_ERRORS
from ocp.mpc.controller_state import ControllerState, Seen
from ocp.mpc.plan_check import HorizonParameters, PlanCheck
from ocp.mpc.plant_input import PlantInput
from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.problem.scaled import sizes_of

# A measurement beyond this many sizes of its state is none: a sensor's largest number.
_ABSURD = 1e8
# A first one beyond this is none, whatever the sizes.
_NUMBERS = 1e20

# t [s] -> parameters and signals of the horizon that starts there, by name.
Parameters = Callable[[float], Mapping[str, ArrayLike]]


class StepInputs(NamedTuple):
    """The data of one control step.

    Attributes:
        t: when the state was measured [s].
        applies_at: when the input acts [s].
        start: the state then (nx,), predicted where need be; of the last plan where nothing is
            measured, NaN for what is missing where nothing was ever measured.
        parameters: of the horizon from ``applies_at`` on.
        now: parameters when the input acts (n_p,).
        parameters_known: False where they are those of the last plan, as far as they reach.
        unsolvable: why the solver cannot be run; empty where it can.
        seen: the measurement, where it is whole.
    """

    t: float
    applies_at: float
    start: np.ndarray
    parameters: HorizonParameters
    now: np.ndarray
    parameters_known: bool
    unsolvable: str
    seen: Seen | None


@dataclass(frozen=True, eq=False, kw_only=True)
class InputCollector:
    """Collects the data of every step; see ``MPC`` for the options.

    Attributes:
        check: the controller's model.
    """

    ocp: OCP
    check: PlanCheck
    dt: float
    applied: PlantInput
    parameters: Parameters | None
    delay: float
    compensate: bool

    def collect(
        self, state: ControllerState, x: ArrayLike, t: float, given: Mapping[str, ArrayLike] | None
    ) -> StepInputs:
        """Check the measurement, get the parameters, and predict the state over the delay."""
        its_t, its_x, shape = self._arguments
        applies_at = check_real(t, its_t) + self.delay
        start = check_numeric(x, its_x)
        if start.shape != shape:
            raise ProblemError(f"{its_x} has shape {start.shape}, {shape} is needed")
        p, unknown = self._horizon_parameters(state, applies_at, given)
        missing = missing_measurement(self.ocp, start, state.seen)
        at_effect, seen = p.at(applies_at), None if missing else Seen(float(t), start.copy())
        if missing:
            start = self._expected(state, start, applies_at, at_effect)
        elif self.compensate and state.pending:
            for k, sent in enumerate(state.pending):
                start = self._next_state(start, sent, t + k * self.dt, at_effect)
        unsolvable = joined(unknown, missing)
        return StepInputs(float(t), applies_at, start, p, at_effect, not unknown, unsolvable, seen)

    def expected(
        self, state: ControllerState, given: Mapping[str, ArrayLike] | None
    ) -> StepInputs | None:
        """Return the data that the next step will have if the model is right; None: nobody knows.

        Args:
            state: what is known after a step.
            given: parameters of the horizon of the next step; None: what the controller's own say.
        """
        seen = state.seen
        # More than one where measurements were missing since.
        steps = 0 if seen is None else len(seen.acting) - state.steps_late
        if seen is None or steps < 1:
            return None
        t = seen.t + steps * self.dt
        p, unknown = self._horizon_parameters(state, t + self.delay, given)
        acting, at_effect = seen.acting, p.at(t + self.delay)
        start = seen.x
        for k, sent in enumerate(acting if self.compensate else acting[:steps]):
            start = self._next_state(start, sent, seen.t + k * self.dt, at_effect)
        return StepInputs(t, t + self.delay, start, p, at_effect, not unknown, unknown, None)

    def _expected(
        self, state: ControllerState, measured: np.ndarray, t: float, p: np.ndarray
    ) -> np.ndarray:
        """Return where the model is at t [s] from the last whole measurement on; else NaN parts.

        What acted in between is known, and may be something else than the last plan.
        """
        seen = state.seen
        count = 0 if seen is None else round((t - seen.t) / self.dt)
        if seen is None or len(seen.acting) < count:
            return _present(self.ocp, measured) if state.plan is None else state.plan.state(t)
        x = seen.x
        for k, sent in enumerate(seen.acting[:count]):
            x = self._next_state(x, sent, seen.t + k * self.dt, p)
        return x

    def _horizon_parameters(
        self, state: ControllerState, t: float, given: Mapping[str, ArrayLike] | None
    ) -> tuple[HorizonParameters, str]:
        """Return the parameters of a horizon from t [s] on, or those of the last plan and why."""
        start, unknown, last = t, "", self._last_input(state)
        if given is not None or self.parameters is None:
            values = self.ocp.parameter_values(
                {**last, **given} if last and given else given or last
            )
        else:
            try:
                told = _told(self.parameters, t)
                values = self.ocp.parameter_values({**last, **told} if last else told)
            except CALLBACK_ERRORS as error:
                if state.input is None:  # the plant has not moved yet: let it be corrected
                    raise
                unknown = f"no parameters from t = {t:g} s on: {error}"
                start, known = (state.plan.t[0], state.plan.parameters) if state.plan else (t, None)
                values = self.ocp.parameter_values({**known, **last} if known else last)
        by_name = values.as_dict() if values.entries else {}
        return HorizonParameters(values, by_name, start, self._duration), unknown

    def _last_input(self, state: ControllerState) -> dict[str, np.ndarray]:
        """Return what was applied last, where a rate counts from it; before all as declared."""
        index = self._rated
        last = state.last_input if index.size else None
        return {} if last is None else {"last_input": last[index]}

    @cached_property
    def _rated(self) -> np.ndarray:
        """Which controls have a rate."""
        return np.asarray(self.ocp.control_rates.index)

    @cached_property
    def _arguments(self) -> tuple[str, str, tuple[int]]:
        """What messages call t and x, and the shape of x."""
        name = f"MPC of {self.ocp.name}"
        return f"{name}: t [s]", f"{name}: x", (self.ocp.model.nx,)

    @cached_property
    def _duration(self) -> float:
        """Of the horizon [s]."""
        return self.ocp.duration

    def _next_state(self, x: np.ndarray, given: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
        """Return the model's state one interval after t [s] under an input, parameters held."""
        if self.applied.what == "rate":
            return x + self.dt * given
        return self.check.next_state(x, given, t, p)


def missing_measurement(ocp: OCP, measured: np.ndarray, seen: Seen | None) -> str:
    """Return why a measured state (nx,) counts as missing; empty where it does not.

    Args:
        ocp: the problem.
        measured: the state.
        seen: the last one that did not; None: there is none to compare with.
    """
    values, plausible = measured.tolist(), _plausible(ocp)
    each = zip(values, plausible, strict=True)
    if all([-most <= value <= most for value, most in each]):
        return ""
    # A problem may have been declared elsewhere than it is used.
    most = np.full(len(values), _NUMBERS)
    if seen is not None:
        most = np.array(plausible) * max(1.0, _ABSURD * (np.abs(seen.x) / plausible).max())
    if (np.abs(measured) <= most).all():
        return ""
    if not all(map(isfinite, values)):
        return "the measurement is not finite"
    worst = int((np.abs(measured) / plausible).argmax())
    return f"the measurement {ocp.model.x_names[worst]} = {values[worst]:.3g} cannot be meant"


def _present(ocp: OCP, measured: np.ndarray) -> np.ndarray:
    """Return a measured state (nx,) with NaN for what is missing."""
    return np.where(np.abs(measured) <= _plausible(ocp), measured, np.nan)


@once_per_problem
def _plausible(ocp: OCP) -> list[float]:
    """Return the largest magnitude of each state that is taken for a measurement."""
    box = ocp.state_bounds
    known = np.abs([ocp.start(), np.asarray(box.lower), np.asarray(box.upper)])
    largest = np.where(np.isfinite(known), known, 0.0).max(axis=0)
    return (_ABSURD * np.maximum(largest, sizes_of(ocp).x)).tolist()


def _told(parameters: Parameters, t: float) -> Mapping[str, ArrayLike]:
    """Return what a callback says of the horizon from t [s] on; None says nothing."""
    given = parameters(t)
    if given is None:
        raise ProblemError("the callback returned None")
    return given


def joined(said: str, more: str) -> str:
    """Return two reasons as one; either may be empty."""
    return f"{said}; {more}" if said and more else said or more
