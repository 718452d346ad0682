"""The CARIMA model: a transfer function with dead time, driven by integrated coloured noise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from models._numbers import vector
from ocp import ProblemError
from ocp.internal import check_instance, check_real, check_whole

# Roots of C closer to the unit circle than this: its filter forgets too slowly to be of use.
_STABLE = 1.0 - 1e-9


@dataclass(frozen=True, eq=False)
class Carima:
    r"""A single-input, single-output plant with noise whose increments are stationary.

    .. math::

        A(z^{-1}) y(t) = z^{-d} B(z^{-1}) u(t-1) + C(z^{-1}) e(t) / \Delta, \qquad
        \Delta = 1 - z^{-1}

    Source: thesis (2.56) to (2.59); [Camacho & Bordons 2007, chapter 4].

    Args:
        a: (1, a1, ..., a_na), coefficients of A by rising delay.
        b: (b0, ..., b_nb), of B.
        c: (1, c1, ..., c_nc), of C; all its zeros inside the unit circle.
        delay: dead time d [steps] beyond the one step that every sampled plant has.

    Raises:
        ProblemError: naming the polynomial that is wrong.
    """

    a: Sequence[float]
    b: Sequence[float]
    c: Sequence[float] = (1.0,)
    delay: int = 0

    def __post_init__(self) -> None:
        """Check the polynomials."""
        for name in ("a", "b", "c"):
            values = np.atleast_1d(np.asarray(getattr(self, name), dtype=object)).ravel()
            if not values.size:
                raise ProblemError(f"carima: {name} has no coefficient")
            checked = vector(getattr(self, name), values.size, f"carima: {name}")
            object.__setattr__(self, name, tuple(checked.tolist()))
        for name in ("a", "c"):
            if getattr(self, name)[0] != 1.0:
                raise ProblemError(f"carima: {name} must begin with 1, not {getattr(self, name)}")
        if not any(self.b):
            raise ProblemError("carima: b is zero, the input has no effect")
        check_whole(self.delay, "carima: delay", least=0)
        outside = np.abs(np.roots(self.c)).max(initial=0.0)
        if outside > _STABLE:
            raise ProblemError(f"carima: c has a zero of modulus {outside:.4g}, 1 or more")

    @property
    def zeros(self) -> np.ndarray:
        """Zeros of the plant in z: roots of B."""
        return np.roots(self.b)

    def simulate(
        self,
        u: ArrayLike,
        *,
        noise: ArrayLike | None = None,
        load: ArrayLike | None = None,
        start: float = 0.0,
    ) -> np.ndarray:
        """Return the outputs y (T + 1,) for inputs u (T,): y[t + 1] is the first to see u[t].

        Args:
            u: inputs from time 0 on; before, the plant rested at the input that gives ``start``
                (at 0 if A has a zero at 1), and u is counted from there.
            noise: e(t), (T + 1,), default 0.
            load: disturbance added to the input, (T,), default 0.
            start: output at rest before time 0.
        """
        inputs = np.asarray(u, dtype=float).ravel()
        steps = len(inputs)
        e = np.zeros(steps + 1) if noise is None else vector(noise, steps + 1, "carima: noise")
        v = np.zeros(steps) if load is None else vector(load, steps, "carima: load")
        plant = CarimaPlant(self, start)
        y = [plant.measure(e[0])]
        for t in range(steps):
            y.append(plant.advance(inputs[t] + v[t], e[t + 1]))
        return np.array(y)


class CarimaPlant:
    """A CARIMA model as something that runs: one input in, one output out."""

    def __init__(self, model: Carima, start: float = 0.0) -> None:
        """Rest at ``start`` with input 0 (counted from the input that keeps it there)."""
        check_instance(model, Carima, "carima plant: model")
        check_real(start, "carima plant: start")
        self.model = model
        self._a = np.convolve(model.a, [1.0, -1.0])
        self._y = [start] * len(self._a)
        self._du = [0.0] * (len(model.b) + model.delay)
        self._e = [0.0] * len(model.c)
        self._u = 0.0

    def measure(self, noise: float = 0.0) -> float:
        """Return the output at time 0, before any input: the first noise is added to it."""
        self._e = [noise, *self._e[:-1]]
        self._y[0] += noise
        return self._y[0]

    def advance(self, u: float, noise: float = 0.0) -> float:
        """Apply an input for one step and return the output at its end."""
        self._du = [u - self._u, *self._du[:-1]]
        self._u = u
        self._e = [noise, *self._e[:-1]]
        delayed = self._du[self.model.delay : self.model.delay + len(self.model.b)]
        y = (
            -np.dot(self._a[1:], self._y[: len(self._a) - 1])
            + np.dot(self.model.b, delayed)
            + np.dot(self.model.c, self._e)
        )
        self._y = [float(y), *self._y[:-1]]
        return float(y)
