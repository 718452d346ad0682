"""How well an answer meets the first-order conditions, judged without the backend's scaling."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.internal import BufferedFunction
from solvers.direct.nlp_result import NlpResult

# Values that agree to this are the same: unknowns are clipped to their bounds.
_SAME = 1e-6


@dataclass(frozen=True)
class OptimalityResidual:
    """Residual of the first-order conditions, not scaled by a backend.

    Attributes:
        gradient: largest entry of the Lagrangian's gradient, among the unknowns that are free.
        multiplier: largest entry of the cost's gradient and of all multipliers.
    """

    gradient: float
    multiplier: float

    def is_stationary(self, tolerance: float) -> bool:
        """Whether the gradient is below the tolerance, relative to 1 + the multipliers."""
        return self.gradient <= tolerance * (1.0 + self.multiplier)


@dataclass(frozen=True, eq=False)
class OptimalityCheck:
    """The first-order conditions of a nonlinear program.

    Attributes:
        function: the ``casadi.nlpsol``, whose gradients are used.
    """

    function: ca.Function

    def __call__(
        self, result: NlpResult, p: np.ndarray, bounds: dict[str, np.ndarray]
    ) -> OptimalityResidual:
        """Return the residual of a result; inf where a derivative is not finite.

        Args:
            result: with its multipliers.
            p: data of the problem.
            bounds: lbx, ubx, lbg, ubg.
        """
        w, free = result.w, bounds["lbx"] < bounds["ubx"]
        *_, cost = self._cost(
            w, p
        )  # fatrop's returns the gradient alone, IPOPT's the cost before it
        _, _, lagrangian, _ = self._lagrangian(w, p, 1.0, result.lam_g)
        slope = lagrangian.ravel() + result.lam_x
        sizes = (cost.ravel()[free], result.lam_g, result.lam_x[free])
        return OptimalityResidual(_largest(slope[free]), max(map(_largest, sizes)))

    def is_value(self, result: NlpResult, p: np.ndarray) -> bool:
        """Return whether cost and constraints are those of the unknowns.

        A backend that fails at once returns zeros for what it has not evaluated.
        """
        f, values, _, _ = self._lagrangian(result.w, p, 1.0, np.zeros_like(result.g))
        cost, g = f.item(), values.ravel()
        is_cost = abs(cost - result.cost) <= _SAME * (1.0 + abs(cost))
        return bool(is_cost and (np.abs(g - result.g) <= _SAME * (1.0 + np.abs(g))).all())

    @cached_property
    def _cost(self) -> BufferedFunction:
        return BufferedFunction(self.function.get_function("nlp_grad_f"))

    @cached_property
    def _lagrangian(self) -> BufferedFunction:
        return BufferedFunction(self.function.get_function("nlp_grad"))


def _largest(values: np.ndarray) -> float:
    """Return the largest absolute value; inf where one is not finite."""
    largest = float(np.abs(values).max(initial=0.0))
    return largest if np.isfinite(largest) else np.inf
