"""Multipliers of constraints, and how they follow from what is violated."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from solvers.constrained.relaxed_problem import (
    END_MULTIPLIER,
    MULTIPLIER,
    PENALTY,
    SCALE,
    RelaxedProblem,
)


@dataclass(frozen=True, eq=False)
class Multipliers:
    """What a relaxed problem is run with.

    Attributes:
        relaxed: whose rows they belong to.
        path: at the nodes, per second, (N + 1, m).
        end: of the terminal rows, (k,).
        penalty: rho.
        scale: sigma, of the whole relaxed cost.
    """

    relaxed: RelaxedProblem
    path: np.ndarray
    end: np.ndarray
    penalty: float
    scale: float = 1.0

    @classmethod
    def zero(cls, relaxed: RelaxedProblem, intervals: int, penalty: float) -> "Multipliers":
        """Return those one starts with."""
        shape = (intervals + 1, relaxed.path.size)
        return cls(relaxed, np.zeros(shape), np.zeros(relaxed.end.size), penalty)

    def parameters(self) -> dict[str, ArrayLike]:
        """Return the values that the relaxed problem takes at run time."""
        given: dict[str, ArrayLike] = {PENALTY: self.penalty, SCALE: self.scale}
        given |= {MULTIPLIER: self.path} if self.path.size else {}
        return given | ({END_MULTIPLIER: self.end} if self.end.size else {})

    def updated(
        self, path: np.ndarray, end: np.ndarray, *, aim: float, penalty: float
    ) -> "Multipliers":
        """Return the multipliers of first order for these values of the rows.

        Args:
            path: (N + 1, m).
            end: (k,).
            aim: how far inside an inequality should end.
            penalty: the next one.
        """
        return replace(
            self,
            path=self._pushed(self.path, path, self.relaxed.path.is_equation, aim),
            end=self._pushed(self.end, end, self.relaxed.end.is_equation, aim),
            penalty=penalty,
        )

    def halfway(self, other: "Multipliers") -> "Multipliers":
        """Return what lies in the middle; of penalties and scales the geometric mean."""
        return replace(
            self,
            path=(self.path + other.path) / 2,
            end=(self.end + other.end) / 2,
            penalty=float(np.sqrt(self.penalty * other.penalty)),
            scale=float(np.sqrt(self.scale * other.scale)),
        )

    def weight_of(self, path: np.ndarray, end: np.ndarray, duration: float) -> float:
        """Return the integral of the multipliers times what is left of the rows, abs(c)."""
        along = np.abs(self.path * path).sum() / (len(self.path) - 1)
        return float(along * duration + np.abs(self.end * end).sum())

    def _pushed(
        self, multiplier: np.ndarray, c: np.ndarray, is_equation: np.ndarray, aim: float
    ) -> np.ndarray:
        inequality = np.maximum(0.0, multiplier + self.penalty * (c + aim))
        return np.where(is_equation, multiplier + self.penalty * c, inequality)
