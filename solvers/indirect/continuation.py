"""Continuation where Newton fails from a guess: from an easier problem to the wanted one."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, ProblemError, UnsupportedProblem
from ocp.internal import (
    ParameterValues,
    RunData,
    check_instance,
    check_not_negative,
    check_positive,
)
from solvers.indirect.newton_iteration import NewtonResult

_SMALLEST_ADVANCE = 1e-3


@dataclass(frozen=True)
class HorizonContinuation:
    """Solve a short horizon first and lengthen it, each solution starting the next.

    Args:
        first: share of the horizon to begin with, in (0, 1).
    """

    first: float = 0.1

    def __post_init__(self) -> None:
        """Check the share."""
        check_positive(self.first, "continuation: first", below=1.0)

    def check(self, ocp: OCP) -> None:
        """Refuse a free final time: the optimiser, not the share, then sets the horizon."""
        if ocp.has_free_time:
            raise UnsupportedProblem(
                f"{ocp.name}: no continuation in the horizon where the final time is free"
            )

    def applied(self, data: RunData, share: float) -> tuple[RunData, float]:
        """Return the data, and the share of the horizon to integrate."""
        return data, share


@dataclass(frozen=True)
class ParameterContinuation:
    """Solve with an easy value of a parameter first and move it to the wanted one.

    Args:
        name: of a ``Parameter`` (or ``Signal``) of the problem.
        easy: its easy value.
        first: share of the way to begin with, in [0, 1).
    """

    name: str
    easy: ArrayLike
    first: float = 0.0

    def __post_init__(self) -> None:
        """Check the share."""
        check_instance(self.name, str, "continuation: name")
        check_not_negative(self.first, "continuation: first", below=1.0)

    def check(self, ocp: OCP) -> None:
        """Refuse a name that the problem does not know, and a value that does not fit."""
        entries = {entry.name: entry for entry in ocp.parameters}
        if self.name not in entries:
            raise ProblemError(
                f"continuation: '{self.name}' is no parameter of {ocp.name}; "
                f"it has {', '.join(entries) or 'none'}"
            )
        shape, wanted = np.shape(self.easy), np.shape(entries[self.name].value)
        if shape not in ((), wanted):
            raise ProblemError(f"continuation: easy has shape {shape}, {wanted} is needed")

    def applied(self, data: RunData, share: float) -> tuple[RunData, float]:
        """Return the data with the parameter moved by ``share``, and the whole horizon."""
        wanted = data.values.as_dict()
        easy = np.broadcast_to(np.asarray(self.easy, dtype=float), wanted[self.name].shape)
        moved = {**wanted, self.name: easy + share * (wanted[self.name] - easy)}
        return replace(data, values=ParameterValues.of(data.values.entries, moved)), 1.0


def advanced(
    continuation: HorizonContinuation | ParameterContinuation,
    data: RunData,
    v: np.ndarray,
    newton: Callable[[RunData, float, np.ndarray], NewtonResult],
) -> Iterator[NewtonResult]:
    """Go from the easy problem to the wanted one; yield every attempt, the wanted one last.

    Steps that succeed are doubled, those that fail quartered (halved until the easiest problem
    is solved); it gives up where they become too small.

    Args:
        continuation: what makes the problem easier.
        data: of the wanted problem.
        v: unknowns to begin with.
        newton: solves for data, a share of the horizon and first unknowns.
    """
    share = continuation.first
    reached, advance = 0.0, continuation.first or 0.5
    while True:
        result = newton(*continuation.applied(data, share), v)
        yield result
        if result.converged and share >= 1.0:
            return
        if result.converged:
            v, reached, advance = result.x, share, 2.0 * advance
        else:
            advance /= 4.0 if reached else 2.0
            if advance < _SMALLEST_ADVANCE:
                return
        share = min(1.0, reached + advance)
