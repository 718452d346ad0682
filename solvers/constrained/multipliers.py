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
        aim: how far inside the update before this run aimed, for inequalities.
        scale: sigma, of the whole relaxed cost.
    """

    relaxed: RelaxedProblem
    path: np.ndarray
    end: np.ndarray
    penalty: float
    aim: float
    scale: float = 1.0

    @classmethod
    def zero(
        cls, relaxed: RelaxedProblem, intervals: int, penalty: float, *, aim: float
    ) -> "Multipliers":
        """Return the multipliers of the first run."""
        shape = (intervals + 1, relaxed.path.size)
        return cls(relaxed, np.zeros(shape), np.zeros(relaxed.end.size), penalty, aim)

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
            path=self._first_order(self.path, path, self.relaxed.path.is_equation, aim),
            end=self._first_order(self.end, end, self.relaxed.end.is_equation, aim),
            penalty=penalty,
            aim=aim,
        )

    def halfway(self, other: "Multipliers") -> "Multipliers":
        """Return the mean; of penalties and scales the geometric mean; the aim of the other."""
        return replace(
            self,
            path=(self.path + other.path) / 2,
            end=(self.end + other.end) / 2,
            penalty=float(np.sqrt(self.penalty * other.penalty)),
            aim=other.aim,
            scale=float(np.sqrt(self.scale * other.scale)),
        )

    def weight_of(self, path: np.ndarray, end: np.ndarray, duration: float) -> float:
        """Return the integral of the multipliers times the values of the rows, abs(mu c)."""
        along = np.abs(self.path * path).sum() / (len(self.path) - 1)
        return float(along * duration + np.abs(self.end * end).sum())

    def _first_order(
        self, multiplier: np.ndarray, c: np.ndarray, is_equation: np.ndarray, aim: float
    ) -> np.ndarray:
        inequality = np.maximum(0.0, multiplier + self.penalty * (c + aim))
        return np.where(is_equation, multiplier + self.penalty * c, inequality)
