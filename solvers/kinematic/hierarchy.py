"""Tasks in strict order, solved at one instant: numbers in, joint velocities out."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from solvers.kinematic.pseudo_inverse import Inverse

# A direction counts as used by a task if J N moves along it by more than this share of
# the task's own J.
_RANK = 1e-6


class Level(NamedTuple):
    """A task at one instant, of one arm or, with leading axes, of many at once.

    Attributes:
        jacobian: J (..., m, n).
        desired_velocity: what J dq/dt should be (..., m).
        activation: between 0 and 1 (...).
        inverse: how J N is inverted.
    """

    jacobian: np.ndarray
    desired_velocity: np.ndarray
    activation: float | np.ndarray
    inverse: Inverse


def prioritised_velocity(levels: Sequence[Level], n: int, *, decoupled: bool) -> np.ndarray:
    r"""Return dq/dt (..., n) of tasks in strict order.

    .. math::

        \dot q_i = \dot q_{i-1} + (J_i N_{i-1})^\# (\dot r_i - J_i \dot q_{i-1}), \qquad
        N_i = N_{i-1} - (J_i N_{i-1})^\# J_i N_{i-1}, \quad N_0 = E

    with two tasks (3.11). A task that is partly active, 0 < α < 1, is α times the answer
    with it plus 1 - α times the answer without it: for the last task that is (3.16), tasks
    below another one are continuous in α, and those above are not affected.

    With ``decoupled`` N_i loses the exact row space of J_i N_(i-1) (its right singular
    vectors), whatever damping the inverse has: damping then costs a task some of its own
    velocity, but lower tasks never disturb higher ones. Otherwise N_i has the damped inverse
    in it, as thesis (3.17) in (3.11), is no projector, and lets them through.

    Source: thesis (3.5)-(3.16); [Siciliano & Slotine 1991]; the separation of
    orthogonalisation and inversion: [An & Lee 2014]; the transition: [Lee, Mansard & Park 2012].

    Args:
        levels: the first has the highest priority; all with the same leading axes.
        n: number of joints.
        decoupled: see above.
    """
    many = np.shape(levels[0].activation) if levels else ()
    velocity, free = np.zeros((*many, n)), np.broadcast_to(np.eye(n), (*many, n, n))
    return _descend(list(levels), velocity, free, decoupled)


def _descend(
    levels: list[Level], velocity: np.ndarray, free: np.ndarray, decoupled: bool
) -> np.ndarray:
    if not levels:
        return velocity
    level, lower = levels[0], levels[1:]
    alpha = np.asarray(level.activation)
    if (alpha <= 0.0).all():
        return _descend(lower, velocity, free, decoupled)
    u, s, vt = np.linalg.svd(level.jacobian @ free, full_matrices=False)
    v = vt.swapaxes(-1, -2)
    gains = level.inverse.gains(s)
    missing = level.desired_velocity - _times(level.jacobian, velocity)
    moved = velocity + _times(v, gains * _times(u.swapaxes(-1, -2), missing))
    size = np.linalg.norm(level.jacobian, axis=(-2, -1))
    used = s > _RANK * size[..., None] if decoupled else gains * s
    with_it = _descend(lower, moved, free - (v * used[..., None, :]) @ vt, decoupled)
    if (alpha >= 1.0).all():
        return with_it
    share = np.clip(alpha, 0.0, 1.0)[..., None]
    return share * with_it + (1.0 - share) * _descend(lower, velocity, free, decoupled)


def _times(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return (matrix @ vector[..., None])[..., 0]
