"""A horizon cut into segments: their schedule, the unknowns, and the trajectories."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ocp import OCP, Grid
from ocp.internal import RunData, node_fractions


@dataclass(frozen=True, eq=False)
class ShootingSchedule:
    """Where in time and parameters a run integrates: S * M steps.

    Attributes:
        t0: initial time [s].
        duration: of the whole horizon [s], where it is not an unknown.
        fractions: step boundaries as fractions of the horizon, (S M + 1,).
        p_left: parameters at the start of each step, (S M, n_p).
        p_right: parameters at the end of each step, (S M, n_p).
        p_first: parameters at t0.
        p_last: parameters at the final time.
    """

    t0: float
    duration: float
    fractions: np.ndarray
    p_left: np.ndarray
    p_right: np.ndarray
    p_first: np.ndarray
    p_last: np.ndarray

    @classmethod
    def of(
        cls, ocp: OCP, data: RunData, steps: int | Grid, share: float = 1.0
    ) -> "ShootingSchedule":
        """Return the schedule of the first ``share`` of the horizon."""
        if share == 1.0 or isinstance(steps, Grid):
            fractions = node_fractions(ocp, steps)
        else:
            fractions = np.linspace(0.0, 1.0, steps + 1)
        left, right = data.values.on(share * fractions)
        return cls(
            t0=data.t0,
            duration=share * ocp.duration,
            fractions=fractions,
            p_left=left,
            p_right=right,
            p_first=data.values.at(0.0)[0],
            p_last=data.values.at(share)[0],
        )

    def reversed(self) -> "ShootingSchedule":
        """Return the same schedule from the end to the start: its steps go back in time."""
        return ShootingSchedule(
            t0=self.t0 + self.duration,
            duration=-self.duration,
            fractions=1.0 - self.fractions[::-1],
            p_left=self.p_right[::-1],
            p_right=self.p_left[::-1],
            p_first=self.p_last,
            p_last=self.p_first,
        )


class ShootingUnknowns(NamedTuple):
    """The unknowns of indirect shooting.

    Attributes:
        z: (x, costate) at the start of each segment, (S, 2 nx).
        mu: multipliers of the initial constraints.
        nu: multipliers of the terminal constraints.
        duration: final time minus t0 [s], the given one where it is fixed.
    """

    z: np.ndarray
    mu: np.ndarray
    nu: np.ndarray
    duration: float


class CanonicalTrajectory(NamedTuple):
    """States, costates and minimising controls at N + 1 instants.

    Attributes:
        t: instants [s], (N + 1,).
        x: states (N + 1, nx).
        costate: (N + 1, nx).
        u: controls (N + 1, nu).
    """

    t: np.ndarray
    x: np.ndarray
    costate: np.ndarray
    u: np.ndarray


@dataclass(frozen=True, eq=False)
class UnknownsLayout:
    """How the unknowns are stacked: z of each segment's start, then mu, nu and the duration."""

    segments: int
    nx: int
    n_mu: int
    n_nu: int
    free_time: bool

    def join(self, z: np.ndarray, mu: np.ndarray, nu: np.ndarray, duration: float) -> np.ndarray:
        """Return the vector of unknowns."""
        return np.concatenate([z.ravel(), mu, nu, [duration] if self.free_time else []])

    def split(self, v: np.ndarray, duration: float) -> ShootingUnknowns:
        """Return the parts of a vector of unknowns; ``duration``: where it is fixed."""
        z, mu, nu, rest = np.split(
            v, np.cumsum([2 * self.nx * self.segments, self.n_mu, self.n_nu])
        )
        duration = float(rest[0]) if self.free_time else duration
        return ShootingUnknowns(z.reshape(self.segments, -1), mu, nu, duration)


@dataclass(frozen=True, eq=False)
class SegmentTrajectories:
    """The canonical flow integrated on every segment.

    Attributes:
        z: (x, costate) at every step, (S, M + 1, 2 nx).
        costs: running cost of every step, (S * M,).
    """

    z: np.ndarray
    costs: np.ndarray

    @property
    def ends(self) -> np.ndarray:
        """Z at the end of each segment, (S, 2 nx)."""
        return self.z[:, -1]

    @property
    def nodes(self) -> np.ndarray:
        """Z at every step of the whole horizon, (S M + 1, 2 nx)."""
        return np.vstack([self.z[:, :-1].reshape(-1, self.z.shape[2]), self.z[-1, -1]])
