r"""Measurements: values that expressions of the state should have at instants, by least squares.

.. math:: \sum_i \Big( \frac{h(x(t_i), t_i) - y_i}{\sigma_i} \Big)^2
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_instance, check_numeric
from ocp.checks.errors import ProblemError
from ocp.checks.expressions import check_column, readable
from ocp.checks.rich_text import counted
from ocp.problem.portable import Portable


@dataclass(frozen=True, eq=False)
class Measurement(Portable):
    """What was measured at instants: the cost gains the sum of squares of ``(h - y) / sigma``.

    Args:
        name: what a message calls it.
        expression: h, a column (m,) in states, t, parameters and unknown constants.
        times: instants [s] since the start of the horizon, increasing, (K,).
        values: y, (K, m), or (K,) where m is 1; NaN where there is none.
        sigma: standard deviation of the error, a number, (m,) or (K, m), in the unit of y. A
            common factor of all changes no estimate; where it is not known, ``estimate`` finds it.

    Raises:
        ProblemError: naming the measurement and what is wrong with it.
    """

    name: str
    expression: ca.SX
    times: ArrayLike
    values: ArrayLike
    sigma: ArrayLike = 1.0

    def __post_init__(self) -> None:
        """Stack the expression, size the numbers."""
        check_instance(self.name, str, "the name of a measurement")
        what = f"measurement '{self.name}'"
        expression = check_column(self.expression, what)
        times = check_numeric(self.times, f"{what}: times")
        if times.ndim != 1 or not len(times) or not np.isfinite(times).all():
            raise ProblemError(f"{what}: times are no finite instants (K,)")
        if not (np.diff(times) > 0.0).all():
            raise ProblemError(
                f"{what}: times must increase; what was measured twice is another Measurement"
            )
        shape = (len(times), expression.numel())
        values = check_numeric(self.values, f"{what}: values")
        if values.ndim == 1 and shape[1] == 1:
            values = values[:, None]
        if values.shape != shape:
            raise ProblemError(f"{what}: values have shape {values.shape}, {shape} is needed")
        if np.isinf(values).any():
            raise ProblemError(f"{what}: a value is infinite; NaN stands for what is missing")
        missing = np.isnan(values).all(axis=0)
        if missing.any():
            raise ProblemError(f"{what}: row {int(missing.argmax())} has no value at all")
        sigma = check_numeric(self.sigma, f"{what}: sigma")
        if sigma.shape not in ((), shape[1:], shape):
            raise ProblemError(f"{what}: sigma has shape {sigma.shape}, {shape} is needed")
        if not ((sigma > 0.0) & np.isfinite(sigma)).all():
            raise ProblemError(f"{what}: sigma must be positive")
        sigma = np.broadcast_to(sigma, shape).copy()
        for name, value in (("times", times), ("values", values), ("sigma", sigma)):
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        object.__setattr__(self, "expression", expression)

    def __repr__(self) -> str:
        """Return one line: of what, and how often."""
        rows = ", ".join(readable(row) for row in ca.vertsplit(self.expression))
        return f"<Measurement '{self.name}': {rows} at {counted(len(self.weights), 'instant')}>"

    @property
    def size(self) -> int:
        """Number of rows m."""
        return self.expression.numel()

    @property
    def weights(self) -> np.ndarray:
        """1 / sigma^2, 0 where there is no value, (K, m)."""
        return np.where(np.isnan(self.values), 0.0, 1.0 / np.square(np.asarray(self.sigma)))

    @property
    def known(self) -> np.ndarray:
        """The values, 0 where there is none, (K, m)."""
        return np.nan_to_num(np.asarray(self.values))

    def residuals(self, h: np.ndarray) -> np.ndarray:
        """Return (h - y) / sigma for h (K, m), NaN where there is no value."""
        return (h - np.asarray(self.values)) / np.asarray(self.sigma)
