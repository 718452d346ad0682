"""How far one orientation is from another."""

import math

import casadi as ca
import numpy as np

from ocp import ProblemError

# Below this sin^2 of half the angle the series is used; its rest is then below rounding.
_SMALL = 1e-2
_TERMS = 9


def rotation_error(desired: ca.SX | np.ndarray, actual: ca.SX) -> ca.SX:
    r"""Return :math:`\log(R_d' R)^\vee` (3,) [rad]: the turn from one frame to another.

    Its direction is the axis, in either frame, its length the angle. For small errors its rate is
    the angular velocity against the desired frame, so that it is the orientation's part of a task.
    With :math:`E = R_d' R` and :math:`x = (3 - \mathrm{tr} E) / 4 = \sin^2(\theta / 2)`

    .. math::

        \log(E)^\vee = \frac{\theta}{\sin\theta} \, \frac{(E - E')^\vee}{2}, \quad
        \frac{\theta}{\sin\theta} = \sum_k \frac{4^k (k!)^2}{(2k + 1)!} \, x^k
        = 1 + \tfrac23 x + \tfrac8{15} x^2 + \dots

    The series stands in for small x, so that value and derivatives are exact at 0. At half a turn
    there are two logarithms and no gradient: the result is then no number. Close to it digits are
    lost, as 1e-16 / (π - θ).

    Args:
        desired: R_d (3, 3).
        actual: R (3, 3).

    Raises:
        ProblemError: on another shape.
    """
    for matrix, what in ((desired, "desired"), (actual, "actual")):
        shape = matrix.shape if isinstance(matrix, ca.SX | ca.DM) else np.shape(matrix)
        if shape != (3, 3):
            raise ProblemError(f"rotation error: {what} has shape {shape}, (3, 3) is needed")
    error = ca.mtimes(ca.SX(desired).T, actual)
    turned = ca.vertcat(
        error[2, 1] - error[1, 2], error[0, 2] - error[2, 0], error[1, 0] - error[0, 1]
    )
    return angle_over_sine((3.0 - ca.trace(error)) / 4.0) * turned / 2.0


def angle_over_sine(x: ca.SX) -> ca.SX:
    """Return θ / sin θ where x = sin^2(θ / 2), with its series for small x."""
    series = ca.SX(0.0)
    for k in reversed(range(_TERMS)):
        series = series * x + 4.0**k * math.factorial(k) ** 2 / math.factorial(2 * k + 1)
    is_small = x < _SMALL
    # The branch that is not taken must have finite derivatives too.
    sine = ca.sqrt(ca.if_else(is_small, _SMALL, x))
    cosine = ca.sqrt(ca.if_else(is_small, 1.0 - _SMALL, 1.0 - x))
    return ca.if_else(is_small, series, ca.atan2(sine, cosine) / (sine * cosine))
