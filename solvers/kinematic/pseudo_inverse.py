"""Inverses of a wide matrix: exact, damped, or damped only where it is nearly singular."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from ocp.internal import check_positive


class Inverse(ABC):
    """J# = V diag(gains(s)) U' for J = U diag(s) V'."""

    @abstractmethod
    def gains(self, singular_values: np.ndarray) -> np.ndarray:
        """Return what takes the place of 1/s for each singular value s >= 0, (k,)."""


@dataclass(frozen=True)
class Exact(Inverse):
    """The pseudo-inverse (3.6): 1/s. Close to a singularity velocities grow without bound.

    Args:
        tolerance: singular values below count as zero, and so does their inverse.
    """

    tolerance: float = 1e-9

    def __post_init__(self) -> None:
        """Check the number."""
        check_positive(self.tolerance, "Exact: tolerance")

    def gains(self, singular_values: np.ndarray) -> np.ndarray:
        """Return 1/s, or 0."""
        s = np.maximum(singular_values, self.tolerance)
        return np.where(singular_values > self.tolerance, 1.0 / s, 0.0)


@dataclass(frozen=True)
class Damped(Inverse):
    r"""The damped pseudo-inverse J'(JJ' + λ²E_m)^-1: s/(s² + λ²), at most 1/(2λ).

    Source: thesis (3.17), with E_m for its E_n: JJ' is (m, m).

    Args:
        factor: λ, in the unit of J, positive.
    """

    factor: float = 0.05

    def __post_init__(self) -> None:
        """Check the number."""
        check_positive(self.factor, "Damped: factor")

    def gains(self, singular_values: np.ndarray) -> np.ndarray:
        """Return s/(s² + λ²)."""
        return singular_values / (singular_values**2 + self.factor**2)


@dataclass(frozen=True)
class Filtered(Inverse):
    r"""Damping that depends on the distance to the singularity, direction by direction.

    .. math:: \lambda^2(s) = \lambda_0^2 \Bigl(1 - \frac{s^2}{\varepsilon^2}\Bigr)
              \; (s < \varepsilon), \quad 0 \text{ otherwise}

    Directions with s >= ε are inverted exactly, so that a regular arm makes no error, and
    the nearly singular ones alone are damped. Source: [Maciejewski & Klein 1988], with the
    factor of [Chiaverini 1997].

    Args:
        factor: λ_0, the damping at the singularity, in the unit of J, positive.
        threshold: ε, in the unit of J, positive.
    """

    factor: float = 0.05
    threshold: float = 0.1

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_positive(self.factor, "Filtered: factor")
        check_positive(self.threshold, "Filtered: threshold")

    def gains(self, singular_values: np.ndarray) -> np.ndarray:
        """Return s/(s² + λ²(s))."""
        share = np.minimum(1.0, singular_values / self.threshold)
        return singular_values / (singular_values**2 + self.factor**2 * (1.0 - share**2))
