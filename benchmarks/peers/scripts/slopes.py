"""Derivatives that some peers ask of their user, from those of the stages."""

from collections.abc import Callable, Mapping

import numpy as np

# Smallest curvature that is left by a projection.
_LEAST = 1e-6


class RollOut:
    """Cost and states as functions of the controls alone.

    Controls are (nu, N + 1), that of the end without effect, parameters (N + 1, np).
    """

    def __init__(self, functions: Mapping[str, Callable]) -> None:
        """Take the functions of a job; what they return may be overwritten by the next call."""
        self._functions = functions

    def gradient(self, x0: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return that of the cost (nu, N + 1): one run ahead, one back."""
        x, slopes = self._along(x0, u, p)
        gradient = np.zeros(u.shape)
        adjoint = self._functions["terminal_slopes"](x, p[-1])[0][:, 0].copy()
        for k in reversed(range(len(slopes))):
            on_x, on_u, cost_x, cost_u = slopes[k]
            gradient[:, k] = cost_u[:, 0] + on_u.T @ adjoint
            adjoint = cost_x[:, 0] + on_x.T @ adjoint
        return gradient

    def sensitivities(self, x0: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return those of the states at the nodes (N + 1, nx, nu, N + 1)."""
        _, slopes = self._along(x0, u, p)
        found = np.zeros((len(p), len(x0), *u.shape))
        for k, (on_x, on_u, *_) in enumerate(slopes):
            found[k + 1] = np.tensordot(on_x, found[k], axes=1)
            found[k + 1, :, :, k] += on_u
        return found

    def _along(self, x0: np.ndarray, u: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, list]:
        """Return the last state, and the first derivatives of the stages."""
        x, slopes = x0, []
        for k, now in enumerate(p[:-1]):
            found = self._functions["stage_slopes"](x, u[:, k], now)[:4]
            slopes.append([block.copy() for block in found])
            x = self._functions["stage"](x, u[:, k], now)[0][:, 0].copy()
        return x, slopes


def projected(hessian: np.ndarray) -> np.ndarray:
    """Return the nearest symmetric matrix with no eigenvalue below a small positive one."""
    values, vectors = np.linalg.eigh(hessian)
    return (vectors * np.maximum(values, _LEAST)) @ vectors.T
