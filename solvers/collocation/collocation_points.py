"""Collocation points on one interval, and the Runge-Kutta matrices that belong to them."""

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.polynomial import Polynomial
from scipy.special import roots_jacobi, roots_legendre

from ocp import ProblemError
from ocp.internal import bernstein, check_choice, check_whole

Family = Literal["radau", "gauss"]
LOWEST, HIGHEST = 2, 5


@dataclass(frozen=True, eq=False)
class CollocationPoints:
    r"""Where the dynamics hold on an interval of length one, and what is integrated with.

    .. math::

        X_i = x_k + h \sum_j A_{ij} f(X_j, u_j), \qquad
        x_{k+1} = x_k + h \sum_j b_j f(X_j, u_j)

    which is the same as a polynomial of degree d through x_k whose slope is f at the points.

    Attributes:
        c: the points, (d,).
        A: integrals of the Lagrange polynomials from 0 to each point, (d, d).
        b: their integrals from 0 to 1, (d,).
        B: the Bernstein polynomials of degree d - 1 at the points, (d, d): u_j = B c.
    """

    c: np.ndarray
    A: np.ndarray
    b: np.ndarray
    B: np.ndarray

    @property
    def degree(self) -> int:
        """Number of points d."""
        return len(self.c)

    @property
    def has_end(self) -> bool:
        """Whether the end of the interval is one of the points."""
        return bool(self.c[-1] == 1.0)

    @classmethod
    def of(cls, family: Family, degree: int) -> "CollocationPoints":
        """Return d points: Radau's with the end of the interval, or Gauss' in its inside.

        With Radau's the method is Radau IIA, of order 2d - 1 and stiffly accurate; with Gauss'
        it is of order 2d. Source: [Hairer & Wanner 1996, IV.5].

        Raises:
            ProblemError: for another family, or a degree outside 2 to 5.
        """
        check_choice(family, ("radau", "gauss"), "collocation: points")
        if check_whole(degree, "collocation: degree") not in range(LOWEST, HIGHEST + 1):
            raise ProblemError(f"a degree of {degree!r}: it is a number from {LOWEST} to {HIGHEST}")
        return _points(family, int(degree))


@cache
def _points(family: Family, degree: int) -> CollocationPoints:
    if family == "gauss":
        c = (1.0 + roots_legendre(degree)[0]) / 2.0
    else:
        # The zeros of P_d - P_(d-1) on [-1, 1] are 1 and those of the Jacobi polynomial (1, 0).
        c = np.append((1.0 + roots_jacobi(degree - 1, 1.0, 0.0)[0]) / 2.0, 1.0)
    integrals = [_lagrange(c, j).integ() for j in range(degree)]
    unit = np.broadcast_to(np.eye(degree), (degree, degree, degree))
    return CollocationPoints(
        c=c,
        A=np.stack([integral(c) - integral(0.0) for integral in integrals], axis=1),
        b=np.array([integral(1.0) - integral(0.0) for integral in integrals]),
        B=bernstein(unit, c),
    )


def _lagrange(c: np.ndarray, j: int) -> Polynomial:
    others = np.delete(c, j)
    return Polynomial.fromroots(others) / np.prod(c[j] - others)
