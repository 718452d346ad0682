"""Newton's method for a square system, damped so that it cannot cycle."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

_SMALLEST_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class NewtonResult:
    """How a Newton iteration ended.

    Attributes:
        x: the best iterate.
        residual: max norm of the residual there.
        converged: whether it is below the tolerance.
        diverged: whether the residual stopped being finite.
        steps: Newton steps taken.
        evaluations: residuals evaluated.
        history: residual norm after each step, the first included.
    """

    x: np.ndarray
    residual: float
    converged: bool
    diverged: bool
    steps: int
    evaluations: int
    history: np.ndarray


Residual = Callable[[np.ndarray], np.ndarray]
Linearise = Callable[[np.ndarray], Callable[[np.ndarray], np.ndarray]]


def newton(
    residual: Residual,
    linearise: Linearise,
    x: np.ndarray,
    *,
    tolerance: float,
    max_steps: int,
    damped: bool,
) -> NewtonResult:
    """Solve residual(x) = 0.

    Damping is affine invariant: a step is halved until the *next* correction, with the same
    Jacobian, is shorter than this one (restricted natural monotonicity test,
    [Deuflhard 2004, 3.3]); unlike a test on the residual it does not depend on the scaling
    of states against costates. Undamped, this is the thesis' (3.50).

    Args:
        residual: x (n,) -> (n,); may return values that are not finite.
        linearise: x -> a function that solves J(x) d = r for d; not finite if J is singular.
        x: first iterate.
        tolerance: on the max norm of the residual.
        max_steps: limit.
        damped: whether to test steps at all.
    """
    r = residual(x)
    evaluations, history, best = 1, [_norm(r)], (x, _norm(r))
    steps = 0
    while steps < max_steps and tolerance < history[-1] < np.inf:
        solve = linearise(x)
        d = -solve(r)
        if not np.isfinite(d).all():
            break
        steps += 1
        x, r, tried = _advance(residual, solve, x, d, damped)
        evaluations += tried
        history.append(_norm(r))
        if history[-1] < best[1]:
            best = (x, history[-1])
        if damped and not tried:
            break
    return NewtonResult(
        x=best[0],
        residual=best[1],
        converged=best[1] <= tolerance,
        diverged=not history[-1] < np.inf,
        steps=steps,
        evaluations=evaluations,
        history=np.array(history),
    )


def _advance(
    residual: Residual, solve: Callable, x: np.ndarray, d: np.ndarray, damped: bool
) -> tuple[np.ndarray, np.ndarray, int]:
    """Take the longest step that passes; 0 evaluations reported if none does."""
    fraction, tried = 1.0, 0
    length = np.linalg.norm(d)
    while True:
        candidate = x + fraction * d
        r = residual(candidate)
        tried += 1
        if not damped:
            return candidate, r, tried
        if np.isfinite(r).all():
            correction = np.linalg.norm(solve(r))
            if correction <= (1.0 - fraction / 4.0) * length:
                return candidate, r, tried
        fraction /= 2.0
        if fraction < _SMALLEST_STEP:
            return x, residual(x), 0


def _norm(r: np.ndarray) -> float:
    return float(np.abs(r).max(initial=0.0)) if np.isfinite(r).all() else np.inf
