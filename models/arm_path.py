"""Can this arm follow this path from this start? Asked in numbers, before a solver is."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.arm import PlanarArm
from models.sampling import sampled
from ocp import Parameter, ProblemError, Signal
from ocp.internal import Portable

# A path may begin this far from the end effector [m].
_ON_PATH = 1e-9
# J counts as rank deficient below this singular value, as a share of the arm's length.
_SINGULAR = 1e-6
# Rounding at the border of the workspace [m].
_BORDER = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class ArmPath(Portable):
    """An end-effector path for an arm.

    Args:
        arm: who moves.
        position: r_d(t, parameters) (2,) [m].
        t: the symbol of time [s].
        horizon: duration [s].
        parameters: those that the path may depend on, with their declared values.
        name: what messages call the problem.
    """

    arm: PlanarArm
    position: ca.SX
    t: ca.SX
    horizon: float
    parameters: tuple[Parameter | Signal, ...]
    name: str

    def error(self, theta: ca.SX) -> ca.SX:
        """Return r(θ) - r_d(t) (2,) [m]."""
        return self.arm.end_effector(theta) - self.position

    def jacobian(self, theta: ca.SX) -> ca.SX:
        """Return J (2, n) [m], the derivative of the error in θ."""
        return self.arm.jacobian(theta)

    @property
    def desired_rate(self) -> ca.SX:
        """J dθ/dt (2,) [m/s] that keeps the error."""
        return ca.densify(ca.jacobian(self.position, self.t))

    def check(self, theta0: np.ndarray, *, must_start_on_path: bool) -> None:
        """Refuse what no controller can do.

        Args:
            theta0: start configuration (n,) [rad].
            must_start_on_path: whether the end effector has to be at the path's start.

        Raises:
            ProblemError: if the path is not finite, has unknown symbols, leaves the
                workspace (naming the time) or begins elsewhere than the arm (naming the
                distance), or if the start is singular.
        """
        times, points = sampled(
            self.position, self.t, self.horizon, self.parameters, f"{self.name}: the path"
        )
        broken = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if broken.size:
            raise ProblemError(f"{self.name}: the path is not finite at t = {times[broken[0]]:g} s")
        if must_start_on_path:
            self._refuse_gap(theta0, points[0])
        self._refuse_singular(theta0)
        self._refuse_unreachable(times, points)

    def _refuse_gap(self, theta0: np.ndarray, start: np.ndarray) -> None:
        gap = np.linalg.norm(np.array(self.arm.end_effector(theta0)).ravel() - start)
        if gap > _ON_PATH:
            raise ProblemError(
                f"{self.name}: the path starts {gap:.3g} m away from the end effector at theta0; "
                "move one of them, or take a correction > 0 or free_start=True"
            )

    def _refuse_singular(self, theta0: np.ndarray) -> None:
        jacobian = np.array(self.arm.jacobian(theta0))
        smallest = np.linalg.svd(jacobian, compute_uv=False)[-1] if self.arm.n > 1 else 0.0
        if smallest < _SINGULAR * sum(self.arm.lengths):
            raise ProblemError(
                f"{self.name}: singular start: J(theta0) is without full rank (smallest singular "
                f"value {smallest:.2g} m); bend the arm"
            )

    def _refuse_unreachable(self, times: np.ndarray, points: np.ndarray) -> None:
        distance = np.linalg.norm(points - np.array(self.arm.base), axis=1)
        inner, outer = self.arm.reach
        reachable = (distance <= outer + _BORDER) & (distance >= inner - _BORDER)
        if not reachable.all():
            first = int(np.flatnonzero(~reachable)[0])
            raise ProblemError(
                f"{self.name}: the path leaves the workspace at t = {times[first]:.4g} s: "
                f"{distance[first]:.4g} m from the base, the arm reaches {inner:g} to {outer:g} m"
            )
