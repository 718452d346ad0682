"""The simulated loop: measure, decide, apply, record."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import (
    check_callable,
    check_instance,
    check_numbers,
    check_positive,
    check_whole,
)
from ocp.checks.errors import ProblemError
from ocp.checks.progress import Interrupted, Progress, told
from ocp.closed_loop.decision import (
    Controller,
    ControlRefused,
    Decision,
    PreparingController,
)
from ocp.closed_loop.delay import delay_steps
from ocp.closed_loop.journal import Journal
from ocp.closed_loop.plant import Plant
from ocp.closed_loop.rollout import Rollout

SensorFault = Callable[[np.ndarray, float], np.ndarray]
Observer = Callable[[np.ndarray, Decision | ControlRefused], None]


def closed_loop(
    controller: Controller,
    plant: Plant,
    x0: ArrayLike,
    duration: float,
    *,
    dt: float,
    seed: int = 0,
    initial_input: ArrayLike | None = None,
    head_start: bool = False,
    sensors: SensorFault | None = None,
    watch: Observer | None = None,
    progress: Progress | None = None,
) -> Rollout:
    """Run a controller on a plant.

    The input decided from the measurement at t acts from t + ``controller.delay`` on. Until the
    first one does, the initial input acts, unless there is a head start. Where the controller
    refuses, the rollout ends and says why.

    Args:
        controller: ``MPC``, ``FeedbackLaw``, or any other ``Controller``.
        plant: the truth.
        x0: true first state (nx,).
        duration: [s], a multiple of dt up to rounding.
        dt: sampling interval [s].
        seed: of noise and jitter.
        initial_input: acts during the delay at the start (m,); default: zero, within bounds.
        head_start: the controller is run from t = -delay on, while the plant is kept at x0, so
            that its first input acts from t = 0 on. It should rest there under the initial input,
            or a delay that is compensated predicts what does not happen. These decisions are
            seen by ``watch``; those of the rollout begin at t = 0.
        sensors: (measurement, t) -> what the controller is told; for missing and wrong ones.
        watch: called with every measurement and decision or refusal, as a ``FlightRecorder`` is;
            where it raises ``OSError``, as on a full disk, a warning says so, and it is called no
            more.
        progress: told after each step how many are done, and which rungs decided; an ``OSError``
            of it is treated as one of ``watch``.

    Raises:
        ProblemError: if the plant takes another input than the controller sends, the duration is
            no multiple of dt, or a function of the plant returns what does not fit.
        Interrupted: on Ctrl-C; its ``so_far`` is the rollout until then.
    """
    report = _WhileItLasts(told(progress, "closed loop"), "reports no more")
    _check(controller, plant, sensors, watch)
    steps = _steps(duration, dt)
    check_whole(seed, "closed loop: seed", least=0)
    first = _first_input(plant, initial_input)
    controller.reset(first)
    late = delay_steps(controller.delay, dt)
    journal = Journal.begun(plant.ocp, plant.started(x0, seed), late)
    observer = _WhileItLasts(watch, "is watched no more") if watch else None
    loop = _Loop(controller, dt, sensors, observer, journal, [] if head_start else [first] * late)
    try:
        for k in range(-late if head_start else 0, steps):
            decision = loop.step(k)
            if decision is None:
                break
            said = f"t = {journal.running.t:.4g} s, {decision.source.name.lower()}"
            report(max(k + 1, 0), steps, said)
            if not np.isfinite(journal.running.x).all():
                journal.ended = "the plant's state blows up"
                break
    except KeyboardInterrupt:
        journal.ended = "stopped by Ctrl-C"
        raise Interrupted("the loop", journal.rollout()) from None
    return journal.rollout()


def _check(
    controller: Controller, plant: Plant, sensors: SensorFault | None, watch: Observer | None
) -> None:
    """Refuse what is none of these."""
    check_instance(controller, Controller, "closed loop: controller")
    check_instance(plant, Plant, "closed loop: plant")
    for fault, what in ((sensors, "sensors"), (watch, "watch")):
        if fault is not None:
            check_callable(fault, f"closed loop: {what}")


def _steps(duration: float, dt: float) -> int:
    """Return how many intervals of dt [s] a duration [s] has."""
    check_positive(dt, "closed loop: dt [s]")
    check_positive(duration, "closed loop: duration [s]")
    steps = round(duration / dt)
    if steps < 1 or abs(steps * dt - duration) > 1e-6 * dt:
        raise ProblemError(f"closed loop: {duration} s is no multiple of dt = {dt} s")
    return steps


def _first_input(plant: Plant, given: ArrayLike | None) -> np.ndarray:
    """Return what acts until the first decision does (m,)."""
    m = plant.ocp.model.nu
    if given is None:
        return plant.ocp.control_bounds.clip(np.zeros(m))
    return check_numbers(given, m, "closed loop: initial_input")


@dataclass(frozen=True, eq=False)
class _Loop:
    """A controller and a plant while they run.

    Attributes:
        controller: who decides.
        dt: sampling interval [s].
        sensors: what the controller is told of a measurement.
        watch: what is told of each decision or refusal.
        journal: the plant, and what is recorded of it.
        ahead: inputs that are decided and do not act yet, the next one first.
    """

    controller: Controller
    dt: float
    sensors: SensorFault | None
    watch: "_WhileItLasts | None"
    journal: Journal
    ahead: list[np.ndarray]

    def step(self, k: int) -> Decision | None:
        """Measure, decide, apply and record; before t = 0 (k < 0) the plant is kept.

        None where the controller refuses; the journal then says why.
        """
        running = self.journal.running
        t = running.t if k >= 0 else k * self.dt
        measured = running.measure()
        seen = self.sensors(measured, t) if self.sensors else measured
        try:
            decision = self._decided(seen, t)
        except ControlRefused as refusal:
            self.journal.ended = str(refusal)
            return None
        if isinstance(self.controller, PreparingController):
            self.controller.prepare_next()
        self.ahead.append(decision.input)
        if k >= 0:
            self.journal.advance(seen, decision, self.ahead.pop(0), self.dt)
        return decision

    def _decided(self, seen: np.ndarray, t: float) -> Decision:
        """Run one step of the controller, and pass its decision or refusal to ``watch``."""
        try:
            decision = self.controller.step(seen, t)
        except ControlRefused as refusal:
            if self.watch:
                self.watch(seen, refusal)
            raise
        plant = self.journal.ocp
        if decision.input.shape != (plant.model.nu,):
            raise ProblemError(
                f"closed loop: the controller sends {decision.input.size} inputs, "
                f"the plant '{plant.name}' takes {plant.model.nu}"
            )
        if self.watch:
            self.watch(seen, decision)
        return decision


@dataclass(eq=False)
class _WhileItLasts:
    """Calls a function until the system fails it: a full disk does not stop a plant.

    Attributes:
        function: of the user.
        then: what the loop does without it, in words.
    """

    function: Callable[..., object]
    then: str
    failed: bool = False

    def __call__(self, *given: object) -> None:
        if self.failed:
            return
        try:
            self.function(*given)
        except OSError as error:
            self.failed = True
            said = f"closed loop: {error}; the loop goes on and {self.then}"
            warnings.warn(said, RuntimeWarning, stacklevel=3)
