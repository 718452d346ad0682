"""Solve a problem with slack controls, and return a solution of it as it was written."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ocp.problem.ocp import OCP
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess, Program


class WithSlacks(Protocol):
    """A problem, and the same one with more controls behind its own."""

    @property
    def original(self) -> OCP:
        """The problem as it was written."""
        ...

    def slacks(self, fractions: np.ndarray, x: np.ndarray | None, u: np.ndarray) -> np.ndarray:
        """Return the further controls that fit a trajectory.

        Args:
            fractions: of the horizon, (k,).
            x: states (k, nx); None: the start.
            u: controls (k, nu).
        """
        ...


@dataclass(frozen=True, eq=False)
class SlackProgram(Program):
    """A program with slack controls, asked and answering without them.

    Attributes:
        extended: the problem without slacks, and how they follow.
        program: solves the one with slacks; its costs are those of this one.
    """

    extended: WithSlacks
    program: Program

    @property
    def is_stateful(self) -> bool:
        """Whether an answer depends on the runs before it."""
        return self.program.is_stateful

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Solve for these data, see ``Program.run``."""
        original = self.extended.original
        given = None if guess is None else _GuessWithSlacks(guess, self.extended)
        solution = self.program.run(x0=x0, t0=t0, parameters=parameters, guess=given)
        return solution.with_(problem=original, u=solution.u[:, : original.model.nu])


@dataclass(frozen=True, eq=False)
class _GuessWithSlacks:
    """A guess of the original problem, sampled with the slacks that fit."""

    guess: InitialGuess
    extended: WithSlacks

    @property
    def duration(self) -> float | None:
        return self.guess.duration

    def sample(self, part: str, fractions: np.ndarray, width: int) -> np.ndarray | None:
        m = self.extended.original.model
        if part != "u":
            return self.guess.sample(part, fractions, width)
        u = self.guess.sample("u", fractions, m.nu)
        if u is None:
            return None
        x = self.guess.sample("x", fractions, m.nx)
        return np.hstack([u, self.extended.slacks(fractions, x, u)])
