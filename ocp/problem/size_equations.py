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
    matrix, right = _system(every, size)
    is_limit = np.array([e.is_limit for e in every], dtype=bool)
    if is_limit.all() or not is_limit.any():
        return _least_squares(matrix, right)
    others = matrix[~is_limit]
    logs = _least_squares(others, right[~is_limit])
    far = [k for k in np.flatnonzero(is_limit) if _is_far(every[k], logs)]
    if not far:
        return _least_squares(matrix, right)
    # What the others determine is left where it is by the projection on their rows.
    known = np.abs(np.diag(np.linalg.pinv(others, rcond=1e-9) @ others) - 1.0) < 1e-6
    left_out = [k for k in far if known[[*every[k].plus, *every[k].minus]].all()]
    return _least_squares(np.delete(matrix, left_out, axis=0), np.delete(right, left_out))


def _is_far(limit: SizeEquation, logs: np.ndarray) -> bool:
    apart = limit.value - logs[list(limit.plus)].sum() + logs[list(limit.minus)].sum()
    return not apart < _FAR


def _system(equations: list[SizeEquation], size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return matrix and right-hand side; an index may occur twice in an equation."""
    matrix = np.zeros((len(equations), size))
    for row, equation in zip(matrix, equations, strict=True):
        for i in equation.plus:
            row[i] += equation.weight
        for i in equation.minus:
            row[i] -= equation.weight
    return matrix, np.array([e.weight * e.value for e in equations])


def _least_squares(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    if not len(right):
        return np.zeros(matrix.shape[1])
    return np.linalg.lstsq(matrix, right, rcond=1e-9)[0]
