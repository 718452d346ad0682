"""Equations between sizes, in logarithms, and what solves them best."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

# A limit so many sizes away, in logarithms, says nothing of them.
_FAR = float(np.log(1e4))


class SizeEquation(NamedTuple):
    """weight * (sum of log sizes at ``plus`` - those at ``minus`` - ``value``) = 0.

    One of a limit, which may be written far away to mean that there is none, is left out where
    everything else says that nothing comes near it.
    """

    weight: float
    plus: tuple[int, ...]
    minus: tuple[int, ...]
    value: float
    is_limit: bool = False


def solved(equations: Iterable[SizeEquation], size: int) -> np.ndarray:
    """Return the logarithms by least squares, 0 for what nothing is known of."""
    every = list(equations)
    others = [e for e in every if not e.is_limit]
    if len(others) == len(every) or not others:
        return _least_squares(every, size)
    matrix = np.array([_row(e, size) for e in others])
    # What the others determine is left where it is by the projection on their rows.
    known = np.abs(np.diag(np.linalg.pinv(matrix, rcond=1e-9) @ matrix) - 1.0) < 1e-6
    logs = _least_squares(others, size)

    def is_near(e: SizeEquation) -> bool:
        apart = e.value - logs[list(e.plus)].sum() + logs[list(e.minus)].sum()
        return apart < _FAR or not known[[*e.plus, *e.minus]].all()

    return _least_squares([e for e in every if not e.is_limit or is_near(e)], size)


def _least_squares(equations: list[SizeEquation], size: int) -> np.ndarray:
    if not equations:
        return np.zeros(size)
    matrix = np.array([_row(e, size) for e in equations])
    right = np.array([e.weight * e.value for e in equations])
    return np.linalg.lstsq(matrix, right, rcond=1e-9)[0]


def _row(equation: SizeEquation, size: int) -> np.ndarray:
    row = np.zeros(size)
    np.add.at(row, list(equation.plus), equation.weight)
    np.subtract.at(row, list(equation.minus), equation.weight)
    return row
