"""Prediction with a CARIMA model: free response of the past, forced response of the future."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ocp import ProblemError
from solvers.predictive.diophantine import Split, added, delayed, diophantine


@runtime_checkable
class CarimaModel(Protocol):
    """The polynomials of thesis (2.56), by rising delay, and the dead time [steps]."""

    @property
    def a(self) -> Sequence[float]:
        """A, beginning with 1."""
        ...

    @property
    def b(self) -> Sequence[float]:
        """B."""
        ...

    @property
    def c(self) -> Sequence[float]:
        """C, beginning with 1, zeros inside the unit circle."""
        ...

    @property
    def delay(self) -> int:
        """Dead time d."""
        ...


@dataclass(frozen=True, eq=False)
class CarimaPrediction:
    r"""Outputs y(t + N1) ... y(t + N2) as an affine function of future increments.

    .. math:: \hat y = G \, \Delta u + f

    Thesis (2.63) to (2.74). With coloured noise, C is split instead of 1,
    :math:`C = E_j A \Delta + z^{-j} F_j`, and what is measured is filtered by 1/C:

    .. math::

        \hat y(t+j) = F_j \, \frac{y(t)}{C} + E_j B \, \frac{\Delta u(t+j-d-1)}{C}, \qquad
        E_j B = G_j C + z^{-j} \Gamma_j

    where G_j multiplies increments as they are: it holds the step response g_0 ... g_{j-1}.

    Attributes:
        model: the plant.
        n1: first predicted output.
        n2: last predicted output.
        nu: number of future increments, after which the input is held.
    """

    model: CarimaModel
    n1: int
    n2: int
    nu: int

    @property
    def window(self) -> range:
        """The steps j ahead that are predicted."""
        return range(self.n1, self.n2 + 1)

    @cached_property
    def difference(self) -> np.ndarray:
        """A (1 - z^-1)."""
        return np.convolve(self.model.a, [1.0, -1.0])

    @cached_property
    def splits(self) -> tuple[Split, ...]:
        """E_j and F_j for j = 1 ... N2 (2.61)."""
        return tuple(diophantine(self.model.c, self.difference, self.n2))

    @cached_property
    def step_response(self) -> np.ndarray:
        """g_0 ... g_{N2 - 1}: response to a unit step of the input, without the dead time."""
        return diophantine(self.model.b, self.difference, self.n2)[-1].quotient

    @cached_property
    def forced(self) -> np.ndarray:
        """G of 2.73, (N2 - N1 + 1, Nu): effect of each increment on each output."""
        g, d = self.step_response, self.model.delay
        lag = np.array(self.window)[:, None] - 1 - d - np.arange(self.nu)
        return np.where(lag >= 0, g[np.maximum(lag, 0)], 0.0)

    @cached_property
    def on_outputs(self) -> list[np.ndarray]:
        """F_j, of the filtered outputs y(t), y(t - 1), ..., for each predicted step."""
        return [self.splits[j - 1].remainder for j in self.window]

    @cached_property
    def on_increments(self) -> list[np.ndarray]:
        """What multiplies the filtered past increments Du(t), Du(t - 1), ... (2.72).

        The one of Du(t) itself, which is not past, is 0.
        """
        return [self._past(j) for j in self.window]

    def _past(self, j: int) -> np.ndarray:
        c, d = np.asarray(self.model.c), self.model.delay
        g = self.step_response[:j]
        rest = diophantine(np.convolve(self.splits[j - 1].quotient, self.model.b), c, j)[-1]
        # G_j Du(t + j - d - 1): its term i is past where i > j - d - 1.
        lag = np.arange(j) - (j - d - 1)
        known = np.zeros(d + 1)
        known[lag[lag > 0]] = g[lag > 0]
        return added(np.convolve(known, c), delayed(rest.remainder, d + 1))

    def free(self, outputs: ArrayLike, inputs: ArrayLike) -> np.ndarray:
        """Return f: the outputs if the input stays at u(t - 1), (N2 - N1 + 1,).

        Args:
            outputs: measured outputs, oldest first, y(t) last; before, they were as the oldest.
            inputs: past inputs, oldest first, u(t - 1) last; before, they were as the oldest.
        """
        y, du = self._filtered(outputs, inputs)
        pairs = zip(self.on_outputs, self.on_increments, strict=True)
        return np.array([f @ y[: len(f)] + h @ du[: len(h)] for f, h in pairs])

    def noise(self, outputs: ArrayLike, inputs: ArrayLike) -> float:
        """Return e(t): how far the last output is from what the one before it predicted."""
        y, du = self._filtered(outputs, inputs)
        delayed_b = delayed(np.asarray(self.model.b, dtype=float), self.model.delay + 1)
        a = self.difference
        return float(a @ y[: len(a)] - delayed_b @ du[: len(delayed_b)])

    def _filtered(self, outputs: ArrayLike, inputs: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """y(t), y(t-1), ... and Du(t) = 0, Du(t-1), ..., both divided by C."""
        from scipy.signal import lfilter  # imports half of scipy: a second that few need

        y, u = history(outputs, "outputs"), history(inputs, "inputs")
        c = np.asarray(self.model.c, dtype=float)
        longest = len(self.difference) + len(c) + self.n2
        later = len(self.model.b) + self.model.delay + len(c) + 2
        y = np.concatenate([np.full(longest, y[0]), y])
        du = np.concatenate([np.zeros(later + 1), np.diff(u), [0.0]])
        # At rest before: the filter starts where a constant output leaves it.
        y = y[0] / c.sum() + np.asarray(lfilter([1.0], c, y - y[0]))
        return y[::-1], np.asarray(lfilter([1.0], c, du))[::-1]


def history(values: ArrayLike, what: str) -> np.ndarray:
    """Return measured values as a vector, checked."""
    try:
        result = np.atleast_1d(np.asarray(values, dtype=float)).ravel()
    except (TypeError, ValueError) as error:
        raise ProblemError(f"GPC: {what} is not numeric: {values!r}") from error
    if not result.size or not np.isfinite(result).all():
        raise ProblemError(f"GPC: {what} must be finite numbers, at least one, not {values!r}")
    return result
