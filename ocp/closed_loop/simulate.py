"""The simulated loop: measure, decide, apply, record."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field

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
from ocp.closed_loop.plant import Plant, RunningPlant
from ocp.closed_loop.rollout import Rollout
from ocp.problem.ocp import OCP

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
        progress: told after each step how many are done, and which rungs decided.

    Raises:
        ProblemError: if the plant takes another input than the controller sends, the duration is
            no multiple of dt, or a function of the plant returns what does not fit.
        Interrupted: on Ctrl-C; its ``so_far`` is the rollout until then.
    """
    report = told(progress, "closed loop")
    check_instance(controller, Controller, "closed loop: controller")
    check_instance(plant, Plant, "closed loop: plant")
    for fault, what in ((sensors, "sensors"), (watch, "watch")):
        if fault is not None:
            check_callable(fault, f"closed loop: {what}")
    check_positive(dt, "closed loop: dt [s]")
    check_positive(duration, "closed loop: duration [s]")
    check_whole(seed, "closed loop: seed", least=0)
    steps = round(duration / dt)
    if steps < 1 or abs(steps * dt - duration) > 1e-6 * dt:
        raise ProblemError(f"closed loop: {duration} s is no multiple of dt = {dt} s")
    box, m = plant.ocp.control_bounds, plant.ocp.model.nu
    first = box.clip(np.zeros(m))
    if initial_input is not None:
        first = check_numbers(initial_input, m, "closed loop: initial_input")
    controller.reset(first)
    late = delay_steps(controller.delay, dt)
    observer = _Observing(watch) if watch else None
    journal = _Journal.begun(plant.ocp, plant.started(x0, seed), late)
    ahead = [] if head_start else [first] * late
    try:
        for k in range(-late if head_start else 0, steps):
            t = journal.running.t if k >= 0 else k * dt
            measured = journal.running.measure()
            seen = sensors(measured, t) if sensors else measured
            try:
                decision = _decided(controller, seen, t, plant.ocp, observer)
            except ControlRefused as refusal:
                journal.ended = str(refusal)
                break
            if isinstance(controller, PreparingController):
                controller.prepare_next()
            ahead.append(decision.input)
            if k >= 0:
                journal.advance(seen, decision, ahead.pop(0), dt)
            report(
                max(k + 1, 0),
                steps,
                f"t = {journal.running.t:.4g} s, {decision.source.name.lower()}",
            )
            if not np.isfinite(journal.running.x).all():
                journal.ended = "the plant's state blows up"
                break
    except KeyboardInterrupt:
        journal.ended = "stopped by Ctrl-C"
        raise Interrupted("the loop", journal.rollout()) from None
    return journal.rollout()


def _decided(
    controller: Controller, told: np.ndarray, t: float, plant: OCP, watch: "_Observing | None"
) -> Decision:
    """Run one step of the controller, and pass its decision or refusal to ``watch``."""
    try:
        decision = controller.step(told, t)
    except ControlRefused as refusal:
        if watch:
            watch(told, refusal)
        raise
    if decision.input.shape != (plant.model.nu,):
        raise ProblemError(
            f"closed loop: the controller sends {decision.input.size} inputs, "
            f"the plant '{plant.name}' takes {plant.model.nu}"
        )
    if watch:
        watch(told, decision)
    return decision


@dataclass(eq=False)
class _Observing:
    """Calls an observer until the system fails it: a full disk does not stop a plant."""

    watch: Observer
    failed: bool = False

    def __call__(self, told: np.ndarray, decided: Decision | ControlRefused) -> None:
        if self.failed:
            return
        try:
            self.watch(told, decided)
        except OSError as error:
            self.failed = True
            said = f"closed loop: {error}; the loop goes on and is watched no more"
            warnings.warn(said, RuntimeWarning, stacklevel=3)


@dataclass(eq=False)
class _Journal:
    """What is recorded while a loop runs."""

    ocp: OCP
    running: RunningPlant
    late: int
    t: list[float]
    x: list[np.ndarray]
    measured: list[np.ndarray] = field(default_factory=list)
    inputs: list[np.ndarray] = field(default_factory=list)
    decisions: list[Decision] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)
    violation: float = 0.0
    worst: str = ""
    ended: str = ""

    @classmethod
    def begun(cls, ocp: OCP, running: RunningPlant, late: int) -> "_Journal":
        """Return the journal of a loop before its first step."""
        return cls(ocp, running, late, [running.t], [running.x])

    def advance(self, told: np.ndarray, decision: Decision, acting: np.ndarray, dt: float) -> None:
        """Apply an input for an interval, and record it."""
        cost, excess, worst = self.running.advance(acting, dt)
        if excess > self.violation:
            self.violation, self.worst = excess, worst
        self.measured.append(np.array(told))
        self.inputs.append(acting)
        self.decisions.append(decision)
        self.costs.append(cost)
        self.t.append(self.running.t)
        self.x.append(self.running.x)

    def rollout(self) -> Rollout:
        """Return what was recorded."""
        steps = len(self.x) - 1  # of a step that was interrupted some lists may have an entry more
        for entries in (self.measured, self.inputs, self.decisions, self.costs):
            del entries[steps:]
        t, x = np.array(self.t[: steps + 1]), np.array(self.x)
        m = self.ocp.model
        return Rollout(
            plant=self.ocp,
            t=t,
            x=x,
            measured=np.array(self.measured).reshape(steps, m.nx),
            inputs=np.array(self.inputs).reshape(steps, m.nu),
            sources=tuple(d.source for d in self.decisions),
            messages=tuple(d.message for d in self.decisions),
            costs=np.array(self.costs),
            violation=self.violation,
            violations=self.running.violations,
            worst=self.worst,
            drift=_drift(self.ocp, t, x),
            step_times=np.array([d.time_used for d in self.decisions]),
            clipped=np.array([d.clipped for d in self.decisions]),
            ended=self.ended,
            decisions=tuple(self.decisions),
            late=self.late,
        )


def _drift(ocp: OCP, t: np.ndarray, x: np.ndarray) -> float:
    """Largest violation of the invariants; their parameters are the declared ones."""
    if not ocp.invariants:
        return 0.0
    p = ocp.parameter_values().at(0.0)[0]
    rows = np.array([ocp.functions.invariants(*row, p) for row in zip(x, t, strict=True)])
    return float(ocp.rows.invariants.excess(rows.reshape(len(t), -1)).max(initial=0.0))
