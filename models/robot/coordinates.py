"""Coordinates as they are given to a robot: numbers, or expressions of one kind."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ocp import ProblemError
from ocp.internal import check_numbers


def checked_columns(given: Sequence[Any], n: int, what: str, unknown: ca.SX) -> list[Any]:
    """Return columns (n,), each an expression or a ``DM``.

    Args:
        given: the columns.
        n: their size.
        what: how a message calls them.
        unknown: symbols of the payload, which expressions have to go together with.

    Raises:
        ProblemError: on a wrong size, on NaN, and where ``SX`` and ``MX`` meet.
    """
    kinds = {type(value) for value in given if isinstance(value, ca.SX | ca.MX)}
    if len(kinds) > 1:
        raise ProblemError(f"{what}: coordinates are SX and MX: give all of one kind")
    if ca.MX in kinds and unknown.numel():
        raise ProblemError(
            f"{what}: coordinates are MX, and the payload has symbols, which are SX: give SX, and "
            "call a Function of them with MX"
        )
    return [_column(value, n, what) for value in given]


def _column(value: Any, n: int, what: str) -> Any:
    """Return coordinates (n,) as an expression, or as numbers."""
    if isinstance(value, ca.SX | ca.MX):
        if value.shape != (n, 1):
            raise ProblemError(f"{what}: coordinates of shape {value.shape}, ({n}, 1) is needed")
        return value
    numbers = np.array(value) if isinstance(value, ca.DM) else value
    return ca.DM(check_numbers(numbers, n, f"{what}: coordinates", repeat=False))
