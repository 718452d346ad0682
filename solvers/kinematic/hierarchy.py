"""Tasks in strict order, solved at one instant: numbers in, joint velocities out."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from solvers.kinematic.pseudo_inverse import Inverse

# A direction counts as used up by a task if J N moves along it by more than this share of
# the task's own J.
_RANK = 1e-6


class Level(NamedTuple):
    """A task at one instant.

    Attributes:
        jacobian: J (m, n).
        demand: what J dq/dt should be (m,).
        activation: between 0 and 1.
        inverse: how J N is inverted.
    """

    jacobian: np.ndarray
    demand: np.ndarray
    activation: float
    inverse: Inverse


def prioritised_velocity(levels: Sequence[Level], n: int, *, decoupled: bool) -> np.ndarray:
    r"""Return dq/dt (n,) of tasks in strict order.

    .. math::

        \dot q_i = \dot q_{i-1} + (J_i N_{i-1})^\# (\dot r_i - J_i \dot q_{i-1}), \qquad
        N_i = N_{i-1} - (J_i N_{i-1})^\# J_i N_{i-1}, \quad N_0 = E

    with two tasks (3.11). A task that is partly active, 0 < α < 1, is α times the answer
    with it plus 1 - α times the answer without it: for the last task that is (3.16), tasks
    below another one are continuous in α, and those above never notice.

    With ``decoupled`` N_i loses the exact row space of J_i N_(i-1) (its right singular
    vectors), whatever damping the inverse has: damping then costs a task some of its own
    velocity, but lower tasks never disturb higher ones. Otherwise N_i has the damped inverse
    in it, as thesis (3.17) in (3.11), is no projector, and lets them through.

    Source: thesis (3.5)-(3.16); [Siciliano & Slotine 1991]; the separation of
    orthogonalisation and inversion: [An & Lee 2014]; the transition: [Lee, Mansard & Park 2012].

    Args:
        levels: the first has the highest priority.
        n: number of joints.
        decoupled: see above.
    """
    return _descend(list(levels), np.zeros(n), np.eye(n), decoupled)


def _descend(
    levels: list[Level], velocity: np.ndarray, free: np.ndarray, decoupled: bool
) -> np.ndarray:
    if not levels:
        return velocity
    level, lower = levels[0], levels[1:]
    alpha = level.activation
    if alpha <= 0.0:
        return _descend(lower, velocity, free, decoupled)
    u, s, vt = np.linalg.svd(level.jacobian @ free, full_matrices=False)
    gains = level.inverse.gains(s)
    missing = level.demand - level.jacobian @ velocity
    moved = velocity + vt.T @ (gains * (u.T @ missing))
    used = s > _RANK * np.linalg.norm(level.jacobian) if decoupled else gains * s
    with_it = _descend(lower, moved, free - (vt.T * used) @ vt, decoupled)
    if alpha >= 1.0:
        return with_it
    return alpha * with_it + (1.0 - alpha) * _descend(lower, velocity, free, decoupled)
