"""An arm, a straight path, a disc in the way: scenarios with names, fixed or random."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import casadi as ca
import numpy as np

from models._numbers import vector
from models.arm import PlanarArm
from models.distance_cost import Combine, DistanceCost
from models.obstacles import Disc, link_distances
from models.paths import Path, line
from models.redundancy import Cost, Form, redundancy_ocp
from ocp import OCP, ProblemError
from ocp.internal import check_whole

Difficulty = Literal["ordinary", "tight", "low gain", "infeasible"]

_LINKS = (3, 12)
_REACH = 3.0  # total length of a random arm [m]
_HORIZON = 1.5  # [s]
_STEPS = 30  # along the motion without avoidance
_DEXTERITY = 0.3  # smallest singular value of J at a random start, and half of it later [m]
_RADII = (0.9, 2.6)  # a random path stays between these distances from the base [m]
_ATTEMPTS = 10_000


@dataclass(frozen=True, kw_only=True)
class ArmScenario:
    """An arm whose end effector leaves its start on a straight line, with a disc near by.

    Args:
        name: of the scenario.
        theta0: start configuration (n,) [rad].
        obstacle: centre of the disc (2,) [m].
        radius: d_b of the disc [m].
        influence: d_m of the distance cost [m].
        gain: s of the distance cost.
        velocity: of the end effector (2,) [m/s].
        horizon: duration [s].
        lengths: of the links (n,) [m].
        label: what is hard about it; "infeasible": the path of the end effector itself
            passes the centre of the disc closer than its radius.

    Raises:
        ProblemError: from the properties and ``ocp``, where the numbers make no problem.
    """

    name: str
    theta0: tuple[float, ...]
    obstacle: tuple[float, float]
    radius: float
    influence: float
    gain: float
    velocity: tuple[float, float]
    horizon: float = _HORIZON
    lengths: tuple[float, ...] = (1.0, 1.0, 1.0)
    label: str = "ordinary"

    @property
    def arm(self) -> PlanarArm:
        """The arm, its base at the origin."""
        return PlanarArm(self.lengths)

    @property
    def disc(self) -> Disc:
        """The obstacle."""
        return Disc(self.obstacle, self.radius)

    @property
    def path(self) -> Path:
        """The path of the end effector."""
        return line(np.array(self.arm.end_effector(self.theta0)).ravel(), self.velocity)

    @property
    def path_clearance(self) -> float:
        """Smallest distance from the disc's centre to the prescribed path [m].

        No motion of the arm keeps the end effector further away than this.
        """
        start = np.array(self.arm.end_effector(self.theta0)).ravel()
        shares = np.linspace(0.0, 1.0, 2001)[:, None]
        points = start + shares * self.horizon * vector(self.velocity, 2, "velocity")
        return float(np.linalg.norm(points - np.array(self.obstacle), axis=1).min())

    def ocp(
        self,
        combine: Combine = "sum",
        *,
        cost: Cost = "regularised",
        form: Form = "null-space",
        weight: float = 1.0,
        correction: float = 0.0,
        clearance: float | None = None,
        free_start: bool = False,
    ) -> OCP:
        """Return the optimal control problem; for the arguments see ``redundancy_ocp``.

        Args:
            combine: whether p0 counts all links, ``"sum"``, or the ``"closest"``.
            cost: ``"regularised"`` or ``"raw"``.
            form: ``"null-space"`` or ``"velocity"``.
            weight: k of thesis (3.37).
            correction: K of thesis (3.18) [1/s].
            clearance: hard clearance from the disc's centre [m].
            free_start: whether only the end effector's start is fixed.
        """
        return redundancy_ocp(
            self.arm,
            self.path,
            theta0=self.theta0,
            horizon=self.horizon,
            obstacles=(self.disc,),
            distance_cost=DistanceCost(self.gain, self.influence, combine),
            weight=weight,
            cost=cost,
            form=form,
            correction=correction,
            clearance=clearance,
            free_start=free_start,
            name=f"{self.name} {combine}",
        )


def random_scenarios(
    links: int, count: int, *, seed: int, difficulty: Difficulty = "ordinary"
) -> tuple[ArmScenario, ...]:
    """Return scenarios in which the obstacle matters; the same for the same arguments.

    The arm has links of 3 / n m. It starts bent and clear of the disc, its path stays well
    inside the workspace, and without avoidance a link would come deep into the distance of
    influence. A larger ``count`` only appends.

    * ``"ordinary"``: the end effector's path leaves the disc at least 0.15 m aside.
    * ``"tight"``: it passes 0.02 to 0.1 m from the disc's edge.
    * ``"low gain"``: as ordinary, but without avoidance a link would go through the disc
      and the gain is too low to forbid it.
    * ``"infeasible"``: it goes through the disc; no hard clearance of d_b can be kept.

    Args:
        links: number of links n, 3 to 12.
        count: how many.
        seed: of the random numbers.
        difficulty: see above; it is the ``label`` of each scenario.

    Raises:
        ProblemError: if an argument is out of its range.
    """
    if not _LINKS[0] <= check_whole(links, "random scenarios: links") <= _LINKS[1]:
        raise ProblemError(f"random scenarios: links = {links!r}, it must be 3 to 12")
    check_whole(count, "random scenarios: count")
    check_whole(seed, "random scenarios: seed", least=0)
    if difficulty not in get_args(Difficulty):
        raise ProblemError(
            f"random scenarios: difficulty = {difficulty!r}, none of {get_args(Difficulty)}"
        )
    kind = get_args(Difficulty).index(difficulty)
    lottery = _Lottery(PlanarArm((_REACH / links,) * links), difficulty)
    prefix = f"{difficulty.replace(' ', '-')}-{links}-{seed}"
    rngs = [np.random.default_rng([seed, links, kind, i]) for i in range(count)]
    return tuple(lottery.draw(f"{prefix}-{i:03d}", rng) for i, rng in enumerate(rngs))


@dataclass(frozen=True, eq=False)
class _Lottery:
    """Draws scenarios of one kind by rejection."""

    arm: PlanarArm
    difficulty: Difficulty

    def draw(self, name: str, rng: np.random.Generator) -> ArmScenario:
        for _ in range(_ATTEMPTS):
            theta0, velocity = self._start(rng), self._velocity(rng)
            motion = self._motion(theta0, velocity)
            if motion is None:
                continue
            scenario = self._with_disc(name, theta0, velocity, motion, rng)
            if self._is_wanted(scenario, motion):
                return scenario
        raise ProblemError(f"random scenarios: '{name}' was not found")  # pragma: no cover

    def _start(self, rng: np.random.Generator) -> np.ndarray:
        """An arm raised from its base and bent to one side, unevenly (n,) [rad]."""
        others = self.arm.n - 1
        bend = rng.uniform(1.8, 3.2) * rng.dirichlet(np.full(others, 4.0))
        return np.round(np.append(rng.uniform(1.0, 2.5), -bend), 3)

    def _velocity(self, rng: np.random.Generator) -> np.ndarray:
        angle, speed = rng.uniform(-np.pi, np.pi), rng.uniform(0.4, 1.0)
        return np.round(speed * np.array([np.cos(angle), np.sin(angle)]), 3)

    def _motion(self, theta0: np.ndarray, velocity: np.ndarray) -> np.ndarray | None:
        """The motion of least velocity (N + 1, n), if the arm can well follow the path."""
        jacobian = np.array(self._jacobian(theta0))
        start = self.arm.positions(theta0)[0, -1]
        points = start + np.linspace(0.0, _HORIZON, _STEPS + 1)[:, None] * velocity
        radii = np.linalg.norm(points, axis=1)
        if radii.min() < _RADII[0] or radii.max() > _RADII[1] or _dexterity(jacobian) < _DEXTERITY:
            return None
        step, rows = _HORIZON / _STEPS, [theta0]
        for _ in range(_STEPS):
            middle = rows[-1] + step / 2 * np.linalg.pinv(jacobian) @ velocity
            rate = np.linalg.pinv(np.array(self._jacobian(middle))) @ velocity
            rows.append(rows[-1] + step * rate)
            jacobian = np.array(self._jacobian(rows[-1]))
            if _dexterity(jacobian) < _DEXTERITY / 2:
                return None
        return np.array(rows)

    def _with_disc(
        self,
        name: str,
        theta0: np.ndarray,
        velocity: np.ndarray,
        motion: np.ndarray,
        rng: np.random.Generator,
    ) -> ArmScenario:
        radius = float(rng.choice([0.1, 0.2]))
        gains = [1.0, 2.0, 5.0] if self.difficulty == "low gain" else [50.0, 100.0, 200.0, 500.0]
        return ArmScenario(
            name=name,
            theta0=tuple(theta0.tolist()),
            obstacle=tuple(np.round(self._place(motion, radius, rng), 3).tolist()),
            radius=radius,
            influence=float(rng.choice([0.5, 0.6, 0.8])),
            gain=float(rng.choice(gains)),
            velocity=tuple(velocity.tolist()),
            lengths=self.arm.lengths,
            label=self.difficulty,
        )

    def _place(self, motion: np.ndarray, radius: float, rng: np.random.Generator) -> np.ndarray:
        """A centre for the disc, near the path or near a link somewhere on the way (2,)."""
        joints = self.arm.positions(motion)[rng.integers(_STEPS // 3, _STEPS + 1)]
        angle = rng.uniform(-np.pi, np.pi)
        direction = np.array([np.cos(angle), np.sin(angle)])
        if self.difficulty == "tight":
            return joints[-1] + (radius + rng.uniform(0.02, 0.1)) * direction
        if self.difficulty == "infeasible":
            return joints[-1] + rng.uniform(0.0, 0.7) * radius * direction
        link, share = rng.integers(0, self.arm.n), rng.uniform(0.0, 1.0)
        nearest = (1.0 - share) * joints[link] + share * joints[link + 1]
        return nearest + rng.uniform(0.0, 0.4) * direction

    def _is_wanted(self, scenario: ArmScenario, motion: np.ndarray) -> bool:
        distances = np.array(self._distance.map(len(motion))(motion.T, scenario.obstacle)).ravel()
        d_b, d_m = scenario.radius, scenario.influence
        from_base = float(np.linalg.norm(scenario.obstacle))
        aside = scenario.path_clearance - d_b
        if distances[0] < d_b + 0.1 or from_base < d_b + 0.2 or distances.min() > (d_b + d_m) / 2:
            return False
        if self.difficulty == "tight":
            return 0.02 <= aside <= 0.1
        if self.difficulty == "infeasible":
            return aside < 0.0
        return aside >= 0.15 and (self.difficulty == "ordinary" or distances.min() < d_b)

    @cached_property
    def _jacobian(self) -> ca.Function:
        theta = ca.SX.sym("theta", self.arm.n)
        return ca.Function("jacobian", [theta], [self.arm.jacobian(theta)])

    @cached_property
    def _distance(self) -> ca.Function:
        """Distance from a disc's centre to the closest link [m]."""
        theta, center = ca.SX.sym("theta", self.arm.n), ca.SX.sym("center", 2)
        distances = link_distances(self.arm, theta, Disc(center, 1.0))
        return ca.Function("distance", [theta, center], [ca.mmin(distances)])


def _dexterity(jacobian: np.ndarray) -> float:
    """Smallest singular value [m]."""
    return float(np.linalg.svd(jacobian, compute_uv=False)[-1])
