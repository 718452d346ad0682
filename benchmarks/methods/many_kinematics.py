"""Many instantaneous controllers of one scenario at once: what each would cost."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from models import ArmScenario, link_distances
from ocp import OCP, RK4
from ocp.internal import Stage
from solvers import Filtered, PrioritisedKinematics, Repulsion
from solvers.internal import Level, prioritised_velocity


@dataclass(frozen=True, eq=False)
class ManyKinematics:
    """A path to follow and a repulsion below it, for any number of repulsions.

    Attributes:
        scenario: what to control.
        ocp: the same in velocity form; its running cost is what counts.
        levels: (q, t, gains) -> J and desired velocity of the path, the same of the repulsion, its
            activation, norm of the path error. The gains are v0 [m/s], d_m [m], d_i [m].
        stage: one sampling interval of the problem.
    """

    scenario: ArmScenario
    ocp: OCP
    levels: ca.Function
    stage: ca.Function

    @classmethod
    def of(cls, scenario: ArmScenario, ocp: OCP, path: PrioritisedKinematics) -> "ManyKinematics":
        """Compile the laws.

        Args:
            scenario: what to control.
            ocp: the same in velocity form.
            path: the controller whose first task is to follow the path.
        """
        track = path.tasks[0]
        v0, d_m, d_i = gains = [ca.SX.sym(name) for name in ("v0", "d_m", "d_i")]
        repulsion = Repulsion(v0, d_m, d_i)
        distance = ca.mmin(link_distances(scenario.arm, track.q, scenario.disc))
        levels = ca.Function(
            "levels",
            [track.q, track.t, ca.vertcat(*gains)],
            [
                track.jacobian,
                track.desired_velocity,
                ca.densify(ca.jacobian(distance, track.q)),
                v0 * repulsion.velocity_gain(distance),
                repulsion.homogeneous_gain(distance),
                ca.norm_2(track.error),
            ],
        )
        return cls(scenario, ocp, levels, Stage.of(ocp, RK4(), held=True).step)

    def judged(self, gains: np.ndarray, sampling: float) -> tuple[np.ndarray, np.ndarray]:
        """Return cost (K,) and largest path error (K,) [m] of every row of gains (K, 3).

        Args:
            gains: v0 [m/s], d_m [m], d_i [m].
            sampling: interval for which a velocity is held [s].
        """
        count, n = len(gains), self.scenario.arm.n
        steps = round(self.scenario.horizon / sampling)
        t, h = np.linspace(0.0, self.scenario.horizon, steps + 1), self.scenario.horizon / steps
        law = self.levels.map(count)
        q, worst = np.tile(self.scenario.theta0, (count, 1)), np.zeros(count)
        states, velocities = [], []
        for instant in t[:-1]:
            out = [np.array(part) for part in law(q.T, np.full((1, count), instant), gains.T)]
            first = Level(_stacked(out[0], count), out[1].T, np.ones(count), Filtered())
            second = Level(_stacked(out[2], count), out[3].T, out[4].ravel(), Filtered())
            worst = np.maximum(worst, out[5].ravel())
            velocity = prioritised_velocity([first, second], n, decoupled=True)
            states.append(q)
            velocities.append(velocity)
            q = q + h * velocity
        x, u = (np.concatenate(rows).T for rows in (states, velocities))
        none = np.zeros((self.ocp.p.numel(), steps * count))
        now, step = np.repeat(t[:-1], count)[None], np.full((1, steps * count), h)
        costs = np.array(self.stage.map(steps * count)(x, u, now, step, none, none)[1])
        return costs.reshape(steps, count).sum(axis=0), worst


def _stacked(blocks: np.ndarray, count: int) -> np.ndarray:
    """(m, K n), K matrices side by side, as (K, m, n)."""
    return blocks.reshape(len(blocks), count, -1).swapaxes(0, 1)
