"""The motion of a robot from rest to rest, within the limits of its joints and motors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models.robot.robot import Robot
from models.robot.straight_motion import straight_motion
from models.robot.torque_checks import (
    check_parameters,
    check_time,
    checked_configuration,
    usable_limit,
)
from ocp import OCP, Box, Constraint, Guess, Model, Parameter, ProblemError, Rate, Signal
from ocp.internal import (
    check_choice,
    check_instance,
    check_not_negative,
    check_numbers,
    check_positive,
    check_whole,
)

TorqueForm: TypeAlias = Literal["acceleration", "torque"]
TorqueAt: TypeAlias = Literal["middle", "ends"]


def torque_ocp(
    robot: Robot,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    horizon: float,
    form: TorqueForm = "acceleration",
    steps: int | None = None,
    torque_at: TorqueAt = "middle",
    effort_share: float = 1.0,
    velocity_share: float = 1.0,
    jerk: ArrayLike | None = None,
    acceleration_weight: float | None = None,
    parameters: Sequence[Parameter | Signal] = (),
    name: str = "torque-controlled motion",
) -> OCP:
    r"""Return the problem of moving a robot between two configurations at rest.

    .. math::

        \min \int_0^T \sum_i \Big(\frac{\tau_i}{\bar\tau_i}\Big)^2 + w\,\ddot q_i^2 \, dt,
        \quad \tau = M(q) \ddot q + h(q, \dot q), \quad
        \underline q \le q \le \overline q, \; |\dot q| \le \bar v, \; |\tau| \le \bar\tau

    Where a joint has no limit of effort its torque is weighed by 1.

    Forms:

    - ``"acceleration"``: controls (q'', τ), path equation ``"torque"``. The dynamics are linear
      and no mass matrix is inverted: the form to plan with. State (q, q').
    - ``"torque"``: control τ, forward dynamics; w must be 0.

    Both are continuous in time. A method that holds controls over intervals, such as
    ``MultipleShooting``, imposes a path equation at the start of each: within the interval the
    torque that the motion takes drifts away from τ, and the optimum exploits the end of the last
    one. So either take ``Collocation``, whose controls are polynomials, or give ``steps``: a
    problem in discrete time, with q'' held over each step, so that q and q' are exact, and with
    the torque

    - ``torque_at="middle"`` of each step (one equation): τ is the mean of the step to second order,
    - ``torque_at="ends"`` (controls (q'', τ, τ⁺), two equations ``"torque"`` and ``"torque at
      end"``): what the motion takes at the start and the end of each step, both within the limits.

    Start and goal are run arguments: ``run(x0=..., parameters={"goal": ...})``. The guess is the
    straight line in q that starts and ends at rest and without acceleration; for another pair
    take ``torque_ocp(...).guess`` of that pair.

    A payload whose mass is a symbol makes it a run argument:

    .. code-block:: python

        mass = ca.SX.sym("mass")
        loaded = panda().carrying(Payload("panda_hand_tcp", mass))
        ocp = torque_ocp(loaded, ..., parameters=[Parameter("mass", mass, 0.5)])

    Args:
        robot: with masses; its limits bound q, q' and τ.
        start: configuration (n,) [rad] or [m], within the limits.
        goal: configuration (n,), within the limits.
        horizon: T [s].
        form: ``"acceleration"`` or ``"torque"``.
        steps: number of steps of the problem in discrete time; None: continuous time.
        torque_at: where the torque counts in a step.
        effort_share: part of the limits of effort that may be used, at most 1.
        velocity_share: part of the limits of velocity that may be used, at most 1.
        jerk: limit of the rate of q'', a number or (n,) [rad/s^3] or [m/s^3]; q'' then starts at
            0. None: none. In the form ``"acceleration"`` only.
        acceleration_weight: w, 0 or more; None: 1e-3, and 0 in the form ``"torque"``.
        parameters: of what in the robot is a symbol, such as the mass of a payload.
        name: of the problem.

    Raises:
        ProblemError: if a configuration is outside the limits, or a joint has a limit of effort or
            velocity of 0, or the limit of velocity alone makes the horizon too short, naming the
            joint; or if options contradict each other.

    Source: inverse dynamics as a path equation [Ferrolho et al. 2021]; limits in ``JointLimits``.
    """
    check_instance(robot, Robot, f"{name}: robot")
    if not robot.n:
        raise ProblemError(f"{name}: {robot.name} has no joint that moves")
    check_choice(form, ("acceleration", "torque"), f"{name}: form")
    check_choice(torque_at, ("middle", "ends"), f"{name}: torque_at")
    check_parameters(robot, parameters, name)
    duration = check_positive(horizon, f"{name}: horizon")
    weight = 0.0 if form == "torque" else 1e-3
    if acceleration_weight is not None:
        weight = check_not_negative(acceleration_weight, f"{name}: acceleration_weight")
    ends = [
        checked_configuration(robot, q, f"{name}: {w}")
        for q, w in ((start, "start"), (goal, "goal"))
    ]
    velocity = usable_limit(robot, robot.limits.velocity, velocity_share, f"{name}: velocity")
    check_time(robot, ends[1] - ends[0], velocity, duration, name)
    motion = _Motion(
        robot=robot,
        ends=(ends[0], ends[1]),
        horizon=duration,
        effort=usable_limit(robot, robot.limits.effort, effort_share, f"{name}: effort"),
        velocity=velocity,
        weight=weight,
        parameters=tuple(parameters),
        name=name,
    )
    if form == "torque":
        if steps is not None or jerk is not None or weight:
            raise ProblemError(
                f"{name}: form = 'torque' is in continuous time and knows no acceleration: leave "
                "steps and jerk out, and set acceleration_weight=0"
            )
        return motion.by_torque()
    rates = () if jerk is None else (check_numbers(jerk, robot.n, f"{name}: jerk"),)
    if steps is None:
        return motion.by_acceleration(rates)
    return motion.in_steps(check_whole(steps, f"{name}: steps", least=2), torque_at, rates)


@dataclass(frozen=True, eq=False)
class _Motion:
    """What all forms share; limits are those that may be used, (n,) each."""

    robot: Robot
    ends: tuple[np.ndarray, np.ndarray]
    horizon: float
    effort: np.ndarray
    velocity: np.ndarray
    weight: float
    parameters: tuple[Parameter | Signal, ...]
    name: str

    def by_torque(self) -> OCP:
        q, v, effort = self._state(), self._columns("velocity"), self._columns("torque")
        f = ca.vertcat(v, self.robot.forward_dynamics(q, v, effort))
        guess = self._straight()
        return self._problem(
            self._model(q, v, [effort], f),
            self._cost(effort, ca.SX(0.0)),
            Box(-self.effort, self.effort),
            guess=Guess(x=guess[0], u=guess[2]),
        )

    def by_acceleration(self, rates: tuple[np.ndarray, ...]) -> OCP:
        q, v, a, effort = self._symbols()
        needed = self.robot.inverse_dynamics(q, v, a)
        x, accelerations, efforts = self._straight()
        return self._problem(
            self._model(q, v, [a, effort], ca.vertcat(v, a)),
            self._cost(effort, a),
            self._bounds(1),
            constraints=(self._equation("torque", needed - effort),),
            rates=tuple(Rate(a, -most, most) for most in rates),
            guess=Guess(x=x, u=np.hstack([accelerations, efforts])),
        )

    def in_steps(self, steps: int, torque_at: TorqueAt, rates: tuple[np.ndarray, ...]) -> OCP:
        q, v, a, effort = self._symbols()
        dt = self.horizon / steps
        after = _moved(q, v, a, dt)
        x, accelerations, efforts = self._straight()
        if torque_at == "middle":
            controls = [a, effort]
            needed = self.robot.inverse_dynamics(*_moved(q, v, a, dt / 2.0), a)
            equations = (self._equation("torque", needed - effort),)
            cost = self._cost(effort, a)
        else:
            at_end = self._columns("torque at end")
            controls = [a, effort, at_end]
            equations = (
                self._equation("torque", self.robot.inverse_dynamics(q, v, a) - effort),
                self._equation("torque at end", self.robot.inverse_dynamics(*after, a) - at_end),
            )
            cost = (self._cost(effort, a) + self._cost(at_end, a)) / 2.0
        return self._problem(
            self._model(q, v, controls, ca.vertcat(*after), dt),
            dt * cost,
            self._bounds(len(controls) - 1),
            constraints=equations,
            rates=tuple(Rate(a, -most * dt, most * dt) for most in rates),
            guess=Guess(x=x, u=np.hstack([accelerations, *[efforts] * (len(controls) - 1)])),
            horizon=steps,
        )

    # -- parts ----------------------------------------------------------------------

    def _problem(
        self,
        model: Model,
        cost: ca.SX,
        controls: Box,
        *,
        guess: Guess,
        constraints: tuple[Constraint, ...] = (),
        rates: tuple[Rate, ...] = (),
        horizon: float | int | None = None,
    ) -> OCP:
        limits, rest = self.robot.limits, np.zeros(self.robot.n)
        goal = ca.SX.sym("goal", self.robot.n)
        arrival = model.x - ca.vertcat(goal, rest)
        return OCP(
            name=self.name,
            model=model,
            x0=np.concatenate([self.ends[0], rest]),
            horizon=self.horizon if horizon is None else horizon,
            running_cost=cost,
            control_bounds=controls,
            state_bounds=Box(
                np.concatenate([limits.lower, -self.velocity]),
                np.concatenate([limits.upper, self.velocity]),
            ),
            constraints=(*constraints, Constraint("goal", arrival, 0.0, 0.0, at="terminal")),
            parameters=(Parameter("goal", goal, self.ends[1]), *self.parameters),
            rates=rates,
            last_input=rest if rates else None,
            guess=guess,
        )

    def _model(
        self, q: ca.SX, v: ca.SX, controls: list[ca.SX], f: ca.SX, dt: float | None = None
    ) -> Model:
        units = self.robot.units
        efforts = tuple("N" if unit == "m" else "N m" for unit in units)
        first = efforts if len(controls) == 1 else tuple(f"{unit}/s^2" for unit in units)
        return Model(
            name=self.robot.name,
            x=ca.vertcat(q, v),
            u=ca.vertcat(*controls),
            f=f,
            dt=dt,
            x_units=(*units, *(f"{unit}/s" for unit in units)),
            u_units=(*first, *efforts * (len(controls) - 1)),
        )

    def _symbols(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        words = ("velocity", "acceleration", "torque")
        v, a, effort = (self._columns(word) for word in words)
        return self._state(), v, a, effort

    def _state(self) -> ca.SX:
        return ca.vertcat(*[ca.SX.sym(joint) for joint in self.robot.joints])

    def _columns(self, what: str) -> ca.SX:
        return ca.vertcat(*[ca.SX.sym(f"{joint} {what}") for joint in self.robot.joints])

    def _cost(self, effort: ca.SX, a: ca.SX) -> ca.SX:
        return ca.sumsqr(effort / ca.DM(self._sizes)) + self.weight * ca.sumsqr(a)

    def _equation(self, name: str, error: ca.SX) -> Constraint:
        return Constraint(name, error, 0.0, 0.0, nominal=self._sizes)

    def _bounds(self, efforts: int) -> Box:
        free = np.full(self.robot.n, np.inf)
        most = np.concatenate([free, *[self.effort] * efforts])
        return Box(-most, most)

    @property
    def _sizes(self) -> np.ndarray:
        """Limits of effort of the robot itself, 1 where there is none (n,)."""
        limits = self.robot.limits.effort
        return np.where(np.isfinite(limits), limits, 1.0)

    def _straight(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return states, accelerations and torques of the guess, a row per sample."""
        x, a, efforts = straight_motion(self.robot, *self.ends, self.horizon, self.parameters)
        return x, a, np.clip(efforts, -self.effort, self.effort)


def _moved(q: ca.SX, v: ca.SX, a: ca.SX, time: float) -> tuple[ca.SX, ca.SX]:
    """Return position and velocity after a time with a constant acceleration."""
    return q + time * v + time**2 / 2.0 * a, v + time * a
