"""Newton's method for a square system, damped so that it cannot cycle."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

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
        singular: whether it stopped where the Jacobian is singular.
        steps: Newton steps taken.
        evaluations: residuals evaluated.
        history: residual norm after each step, the first included.
    """

    x: np.ndarray
    residual: float
    converged: bool
    diverged: bool
    singular: bool
    steps: int
    evaluations: int
    history: np.ndarray

    @property
    def in_words(self) -> str:
        """How far it came, for a message."""
        where = ", where the Jacobian is singular" if self.singular else ""
        return f"residual {self.residual:.3g} after {self.steps} Newton steps{where}"


T = TypeVar("T")
Residual = Callable[[np.ndarray], tuple[np.ndarray, T]]
Solve = Callable[[np.ndarray], np.ndarray]
Linearise = Callable[[np.ndarray, T], Solve]


def newton(
    residual: Residual[T],
    linearise: Linearise[T],
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
        residual: x (n,) -> its residual (n,), which may be not finite, and whatever
            ``linearise`` can use again.
        linearise: x and that -> a function that solves J(x) d = r for d, not finite where J
            is singular.
        x: first iterate.
        tolerance: on the max norm of the residual.
        max_steps: limit.
        damped: whether to test steps at all.
    """
    iterate = _Iterate(x, *residual(x))
    best, history, evaluations, stalled, singular = iterate, [iterate.norm], 1, False, False
    while not stalled and len(history) <= max_steps and tolerance < iterate.norm < np.inf:
        solve = linearise(iterate.x, iterate.extra)
        d = -solve(iterate.r)
        if not np.isfinite(d).all():
            singular = True
            break
        for fraction in _fractions(damped):
            trial = _Iterate(iterate.x + fraction * d, *residual(iterate.x + fraction * d))
            evaluations += 1
            if not damped or trial.norm <= tolerance or _is_shorter(trial, solve, d, fraction):
                break
        else:
            stalled = True
            continue
        iterate = trial
        history.append(iterate.norm)
        best = min(best, iterate, key=lambda i: i.norm)
    return NewtonResult(
        x=best.x,
        residual=best.norm,
        converged=best.norm <= tolerance,
        diverged=not iterate.norm < np.inf,
        singular=singular,
        steps=len(history) - 1,
        evaluations=evaluations,
        history=np.array(history),
    )


@dataclass(frozen=True, eq=False)
class _Iterate(Generic[T]):
    x: np.ndarray
    r: np.ndarray
    extra: T

    @property
    def norm(self) -> float:
        return float(np.abs(self.r).max(initial=0.0)) if np.isfinite(self.r).all() else np.inf


def _fractions(damped: bool) -> Iterator[float]:
    fraction = 1.0
    while fraction >= (_SMALLEST_STEP if damped else 1.0):
        yield fraction
        fraction /= 2.0


def _is_shorter(trial: _Iterate, solve: Solve, d: np.ndarray, fraction: float) -> bool:
    if trial.norm == np.inf:
        return False
    with np.errstate(over="ignore", invalid="ignore"):  # too long is too long
        return bool(np.linalg.norm(solve(trial.r)) <= (1.0 - fraction / 4.0) * np.linalg.norm(d))
