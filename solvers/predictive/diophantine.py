"""Polynomials in the delay z^-1, and the Diophantine equation that splits past from future."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


class Split(NamedTuple):
    """One step of a division: what is known from the past, what the future adds.

    Attributes:
        quotient: E_j, coefficients by rising delay (j,).
        remainder: F_j, what is left after j steps, without its factor z^-j.
    """

    quotient: np.ndarray
    remainder: np.ndarray


def diophantine(numerator: ArrayLike, denominator: ArrayLike, steps: int) -> list[Split]:
    r"""Divide one polynomial in the delay by another, one step after the other.

    .. math:: N = E_j D + z^{-j} F_j, \qquad \deg E_j = j - 1, \quad j = 1 \dots

    With N = 1 (or C) and D = A (1 - z^-1) this is thesis (2.61). The recursion is that of a
    long division: :math:`E_{j+1} = E_j + f_{j,0} z^{-j}` and
    :math:`F_{j+1} = z (F_j - f_{j,0} D)` [Camacho & Bordons 2007, section 4.2].

    Args:
        numerator: N, by rising delay.
        denominator: D, by rising delay, beginning with 1.
        steps: how many, at least 1.

    Returns:
        the steps j = 1, 2, ...
    """
    d = np.asarray(denominator, dtype=float)
    remainder = np.asarray(numerator, dtype=float)
    quotient, splits = np.empty(0), []
    for _ in range(steps):
        first = remainder[0]
        quotient = np.append(quotient, first)
        remainder = added(remainder, -first * d)[1:]
        remainder = remainder if remainder.size else np.zeros(1)
        splits.append(Split(quotient, remainder))
    return splits


def added(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the sum of two polynomials."""
    result = np.zeros(max(len(p), len(q)))
    result[: len(p)] += p
    result[: len(q)] += q
    return result


def delayed(p: np.ndarray, steps: int) -> np.ndarray:
    """Return z^-steps times a polynomial."""
    return np.concatenate([np.zeros(steps), p])
