"""The grid of a shooting method: data of its intervals, first iterates, integration error."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ocp import OCP, InitialGuess, Integrator
from ocp.internal import (
    BufferedFunction,
    RunData,
    Stage,
    compiled,
    node_widths,
    sizes_of,
)
from solvers.direct.first_trajectory import FirstStates, first_states


@dataclass(frozen=True, eq=False)
class ShootingGrid:
    """A problem on N intervals with one held control each, see ``node_fractions``.

    Attributes:
        ocp: the problem.
        fractions: nodes as fractions of the horizon, (N + 1,).
        rollout: all intervals in a row.
        half_step: every interval on its own, with half the integration step.
    """

    ocp: OCP
    fractions: np.ndarray
    rollout: BufferedFunction
    half_step: BufferedFunction

    @classmethod
    def of(
        cls, ocp: OCP, fractions: np.ndarray, integrator: Integrator, *, fast: bool
    ) -> "ShootingGrid":
        """Build them; ``fast``: as machine code."""
        finer = replace(integrator, steps=2 * integrator.steps)
        steps = [Stage.of(ocp, each, held=True).step for each in (integrator, finer)]
        step, half_step = map(compiled, steps) if fast else steps
        n = len(fractions) - 1
        rollouts = map(BufferedFunction, (step.mapaccum(n), half_step.map(n)))
        return cls(ocp, fractions, *rollouts)

    @property
    def n(self) -> int:
        """Number of intervals N."""
        return len(self.fractions) - 1

    @cached_property
    def _sizes(self) -> np.ndarray:
        return sizes_of(self.ocp).x

    def schedule(self, data: RunData, duration: float) -> list[np.ndarray]:
        """Return t, h and the parameters at both ends of every interval, one column each."""
        left, right = data.values.on(self.fractions)
        t = data.t0 + self.fractions[None, :-1] * duration
        return [t, duration * self._widths, left.T, right.T]

    @cached_property
    def _widths(self) -> np.ndarray:
        """Of the intervals, as fractions of the horizon, (1, N)."""
        return node_widths(self.fractions)[None, :]

    def first_iterate(
        self,
        data: RunData,
        guess: InitialGuess | None,
        duration: float,
        source: FirstStates = "tame",
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return states (N + 1, nx) and controls (N, nu) of a guess.

        A guess without states: see ``first_states``.
        """
        ocp, m, nodes = self.ocp, self.ocp.model, self.fractions
        x = guess.sample("x", nodes, m.nx) if guess else None
        u = guess.sample("u", nodes[:-1], m.nu) if guess else None
        u = ocp.control_bounds.clip(np.zeros((self.n, m.nu)) if u is None else u)

        def rollout() -> np.ndarray:
            after, _ = self.rollout(data.x0, u.T, *self.schedule(data, duration))
            return np.vstack([data.x0, after.T])

        if x is None:
            x = first_states(data.x0, self.n + 1, ocp.state_bounds, rollout, source)
        return x, u

    def error(self, x: np.ndarray, u: np.ndarray, schedule: list[np.ndarray]) -> tuple[float, int]:
        """Return the integration error, relative to size + abs(x), and the node with the largest.

        By how much half the integration step changes the state at the end of an interval; 0 for
        a discrete-time problem.
        """
        if self.ocp.model.is_discrete:
            return 0.0, 0
        after, _ = self.half_step(x[:-1].T, u.T, *schedule)
        moved = np.abs(after.T - x[1:]) / (self._sizes + np.abs(x[1:]))
        worst = int(moved.max(axis=1).argmax())
        return float(moved[worst].max()), worst + 1
