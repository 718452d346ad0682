"""The search direction of a gradient method: steepest descent, or conjugate to the last one."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

DirectionRule = Literal["steepest", "fletcher-reeves", "polak-ribiere"]
Inner = Callable[[np.ndarray, np.ndarray], float]

# A new gradient less orthogonal to the last one than this has lost conjugacy [Powell 1977].
_POWELL = 0.2


@dataclass(frozen=True, eq=False)
class DescentStep:
    """What one iteration leaves to the next.

    Attributes:
        gradient: g, at its start.
        direction: s, of the search.
        slope: (g, s), dJ/dstep, negative for a descent.
        step: length of the step along s.
    """

    gradient: np.ndarray
    direction: np.ndarray
    slope: float
    step: float


def search_direction(
    rule: DirectionRule, g: np.ndarray, last: DescentStep | None, inner: Inner
) -> np.ndarray:
    r"""Return the next direction.

    .. math:: s^j = -g^j + \beta^j s^{j-1}

    with beta = 0 for ``"steepest"``, (g, g) / (g', g') for ``"fletcher-reeves"`` (g' the
    gradient before; Algorithm 2) and max(0, (g, g - g') / (g', g')) for ``"polak-ribiere"``,
    which restarts where conjugacy is lost or the direction would not descend.

    Args:
        rule: one of the three.
        g: gradient (N, nu).
        last: the iteration before, None in the first.
        inner: inner product of two gradients.
    """
    if last is None or rule == "steepest":
        return -g
    norm, norm_last = inner(g, g), inner(last.gradient, last.gradient)
    if rule == "fletcher-reeves":
        return -g + norm / norm_last * last.direction
    mixed = inner(g, last.gradient)
    if abs(mixed) > _POWELL * norm:
        return -g
    s = -g + max(0.0, (norm - mixed) / norm_last) * last.direction
    return s if inner(g, s) < 0.0 else -g
