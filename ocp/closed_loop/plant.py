"""The plant in a simulated loop: the truth, which is not the controller's model."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import (
    check_callable,
    check_instance,
    check_not_negative,
    check_numbers,
    check_whole,
)
from ocp.checks.errors import ProblemError
from ocp.closed_loop.constraint_table import ConstraintTable
from ocp.closed_loop.model_rollout import ModelRollout
from ocp.problem.constraint import Box
from ocp.problem.constraint_rows import Violation
from ocp.problem.ocp import OCP


@dataclass(frozen=True, eq=False, kw_only=True)
class Plant:
    """What the inputs really do.

    The plant is a problem in its own right: its dynamics are the truth, its running cost and
    constraints judge the loop, and its control is what the controller sends. It may differ
    from the controller's problem in anything (parameters, dynamics, obstacles).

    Args:
        ocp: truth, cost and constraints; its horizon does not count, nor what
            is said of a whole trajectory: peaks, data, integrals, constraints at instants.
        substeps: steps of RK4 in each sampling interval.
        process_noise: standard deviation of what is added to the state, per root of a second.
        measurement_noise: standard deviation of what is added to each measurement (nx,).
        disturbance: t -> what is added to the input (m,), unknown to the controller. The sum,
            clipped to ``saturation``, is what acts, costs, and is held against the bounds of the
            plant's control: where it is no part of what those limit, leave them out of ``ocp``.
        saturation: of the actuators; not the control bounds, unless it is given.
        lag: time constant of the actuators [s], 0: none.
        parameters: t -> the value of each parameter and signal at that instant, by name;
            default: the declared ones, of a signal its first sample.
        jitter: each sampling interval is longer or shorter by up to this share of it.

    Raises:
        ProblemError: naming the number that is out of its range.
    """

    ocp: OCP
    substeps: int = 4
    process_noise: ArrayLike = 0.0
    measurement_noise: ArrayLike = 0.0
    disturbance: Callable[[float], ArrayLike] | None = None
    saturation: Box = field(default_factory=Box)
    lag: float = 0.0
    parameters: Callable[[float], Mapping[str, ArrayLike]] | None = None
    jitter: float = 0.0

    def __repr__(self) -> str:
        """Return one line: what it is, and how it differs from its problem."""
        faults = [
            (np.any(self.process_noise), "process noise"),
            (np.any(self.measurement_noise), "measurement noise"),
            (self.disturbance is not None, "disturbance"),
            (self.lag, f"lag {self.lag:g} s"),
            (self.jitter, f"jitter {self.jitter:g}"),
            (self.parameters is not None, "parameters of its own"),
        ]
        said = ", ".join(what for there, what in faults if there)
        return f"<Plant '{self.ocp.name}': {said or 'no fault'}>"

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_instance(self.ocp, OCP, "plant: ocp")
        for entry in self.ocp.unknowns:
            raise ProblemError(
                f"plant: '{entry.name}' of {self.ocp.name} is an unknown constant; a plant needs "
                "its value, as a Parameter"
            )
        for delay in self.ocp.delays:
            raise ProblemError(
                f"plant: '{delay.control}' of {self.ocp.name} has a Delay; in a loop inputs are "
                "late by the delay of the controller, MPC(delay=...)"
            )
        check_whole(self.substeps, "plant: substeps")
        for name in ("disturbance", "parameters"):
            if getattr(self, name) is not None:
                check_callable(getattr(self, name), f"plant: {name}")
        nx, nu = self.ocp.model.nx, self.ocp.model.nu
        for name in ("process_noise", "measurement_noise"):
            object.__setattr__(self, name, check_numbers(getattr(self, name), nx, f"plant: {name}"))
        check_instance(self.saturation, Box, "plant: saturation")
        object.__setattr__(self, "saturation", self.saturation.sized(nu, "plant: saturation"))
        check_not_negative(self.lag, "plant: lag [s]")
        check_not_negative(self.jitter, "plant: jitter", below=1.0)

    def started(self, x0: ArrayLike, seed: int = 0) -> "RunningPlant":
        """Return the plant at rest in a state (nx,) at t = 0."""
        return RunningPlant(self, check_numbers(x0, self.ocp.model.nx, "plant: x0"), seed)


class RunningPlant:
    """A plant at one instant.

    Attributes:
        t: time [s].
        x: true state (nx,).
        violations: the largest violation of every constraint so far, of rates not.
    """

    def __init__(self, plant: Plant, x0: np.ndarray, seed: int) -> None:
        """Start it."""
        self.plant, self.t, self.x = plant, 0.0, np.array(x0)
        self._rng = np.random.default_rng(seed)
        self._acting: np.ndarray | None = None
        discrete = plant.ocp.model.is_discrete
        steps = 1 if discrete else plant.substeps
        self._model = ModelRollout(plant.ocp, steps, control_at_end=not discrete)
        self._declared = plant.ocp.parameter_values().at(0.0)[0]
        self._last_input = plant.ocp.last_input
        self.violations = ConstraintTable()

    def measure(self) -> np.ndarray:
        """Return the state as the sensors have it (nx,)."""
        noise = np.asarray(self.plant.measurement_noise)
        if not noise.any():
            return self.x.copy()
        return self.x + noise * self._rng.standard_normal(len(self.x))

    def advance(self, given: np.ndarray, dt: float) -> tuple[float, float, str]:
        """Apply an input (m,) for one sampling interval [s].

        Returns:
            what that cost, and the largest violation in it with its name.
        """
        plant = self.plant
        dt *= 1.0 + plant.jitter * self._rng.uniform(-1.0, 1.0) if plant.jitter else 1.0
        times = self.t + np.linspace(0.0, dt, self._model.n + 1)
        p = np.array([self._parameters(t) for t in times])
        acted = self._acted(given, times)
        trial = self._model.of(self.x, acted, times, (p[:-1], p[1:]))
        each = self._model.each_excess(trial.x, acted, times, (p[:-1], p[1:]))
        price, of_rate = self._rated(given, dt)
        self.violations = self.violations.with_(plant.ocp, each)
        self.x, self.t = trial.x[-1], float(times[-1])
        noise = np.asarray(plant.process_noise)
        if noise.any():
            self.x = self.x + np.sqrt(dt) * noise * self._rng.standard_normal(len(self.x))
        excess, worst = max((trial.excess, trial.worst), (of_rate.amount, str(of_rate)))
        return trial.cost + price, excess, worst

    def _rated(self, given: np.ndarray, dt: float) -> tuple[float, Violation]:
        """Return what the change since the last input (m,) costs, and by how much it is too fast.

        In continuous time a sampled input counts as if it moved on during the interval dt [s].
        """
        ocp, rates = self.plant.ocp, self.plant.ocp.control_rates
        if not len(rates):
            return 0.0, Violation()
        now, length = given[rates.index], 1.0 if ocp.model.is_discrete else dt
        last = now if self._last_input is None else np.asarray(self._last_input)
        rate, self._last_input = (now - last) / length, now
        found = ocp.rows.rates.largest_violation(rate[None, :], np.array([self.t]))
        return float(rates.weight @ rate**2) * length, found

    def _parameters(self, t: float) -> np.ndarray:
        """Return all parameters and signals at an instant, stacked (n_p,)."""
        if self.plant.parameters is None:
            return self._declared
        now, entries = self.plant.parameters(t), self.plant.ocp.parameters
        missing = [e.name for e in entries if e.name not in now]
        if missing:
            raise ProblemError(f"plant: no value of {', '.join(missing)} at t = {t:g} s")
        told = np.concatenate(
            [check_numbers(now[e.name], e.symbol.numel(), f"plant: '{e.name}'") for e in entries]
        )
        return np.append(told, self._declared[len(told) :])

    def _acted(self, given: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return what the actuators do in each substep (substeps, m)."""
        plant = self.plant
        m, wanted = len(given), np.tile(given, (len(times) - 1, 1))
        if plant.disturbance is not None:
            wanted += [
                check_numbers(plant.disturbance(t), m, "plant: disturbance") for t in times[:-1]
            ]
        wanted = plant.saturation.clip(wanted)
        if plant.lag == 0.0:
            return wanted
        now = wanted[0] if self._acting is None else self._acting
        share = -np.expm1(-np.diff(times) / plant.lag)
        rows = []
        for row, part in zip(wanted, share, strict=True):
            now = now + part * (row - now)
            rows.append(now)
        self._acting = now
        return np.array(rows)
