"""Where states, controls and a free final time stand in the vector of unknowns."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ocp.problem.nominal_sizes import time_unit
from ocp.problem.ocp import OCP


@dataclass(frozen=True, eq=False)
class UnknownsLayout:
    """Unknowns stage by stage: (z_0, u_0, z_1, u_1, ..., z_N).

    z_k are the states x_k at a node, and T where the final time is free: an entry of its own at
    every node, so that the stages are alike.

    Attributes:
        ocp: the problem.
        intervals: number of intervals N; a discrete-time problem brings its own.
    """

    ocp: OCP
    intervals: int

    @property
    def n(self) -> int:
        """Number of intervals."""
        return self.ocp.steps or self.intervals

    @property
    def nz(self) -> int:
        """States per node, the free final time included."""
        return self.ocp.model.nx + int(self.ocp.has_free_time)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.n * (self.nz + self.ocp.model.nu) + self.nz

    def with_time(self, x: np.ndarray, duration: float) -> np.ndarray:
        """Return z (N + 1, nz): states (N + 1, nx), with final time minus t0 [s] if it is free."""
        unknown = np.full((len(x), int(self.ocp.has_free_time)), duration / self.time_unit)
        return np.hstack([x, unknown])

    def join(self, z: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the vector of unknowns of z (N + 1, nz) and u (N, nu)."""
        return np.concatenate([np.hstack([z[:-1], u]).ravel(), z[-1]])

    def iterate(self, x: np.ndarray, u: np.ndarray, duration: float) -> np.ndarray:
        """Return the vector of unknowns of a trajectory.

        Args:
            x: states at the nodes (N + 1, nx).
            u: controls of the intervals (N, nu).
            duration: final time minus t0 [s]; it counts where the final time is free.
        """
        return self.join(self.with_time(x, duration), u)

    def split(self, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return z (N + 1, nz) and u (N, nu) of a vector of unknowns."""
        stages = w[: -self.nz].reshape(self.n, -1)
        return np.vstack([stages[:, : self.nz], w[-self.nz :]]), stages[:, self.nz :]

    @property
    def is_control(self) -> np.ndarray:
        """Which unknowns are controls, bool (size,)."""
        return self._is_control

    @cached_property
    def _is_control(self) -> np.ndarray:
        z, u = np.zeros((self.n + 1, self.nz)), np.ones((self.n, self.ocp.model.nu))
        return self.join(z, u).astype(bool)

    @property
    def is_later_state(self) -> np.ndarray:
        """Which unknowns are states after the start, bool (size,)."""
        z = np.tile(np.arange(self.nz) < self.ocp.model.nx, (self.n + 1, 1)).astype(float)
        z[0] = 0.0
        return self.join(z, np.zeros((self.n, self.ocp.model.nu))).astype(bool)

    def duration(self, w: np.ndarray) -> float:
        """Return final time minus t0 [s] of a vector of unknowns."""
        return float(w[-1]) * self.time_unit if self.ocp.has_free_time else self.ocp.duration

    @cached_property
    def time_unit(self) -> float:
        """What a free final time is measured in [s]."""
        return time_unit(self.ocp)
