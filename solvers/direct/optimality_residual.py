"""How well an answer meets the first-order conditions, judged without the backend's scaling."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from solvers.direct.nlp_backends import NlpResult

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
        cost = self._cost(x=w, p=p)["grad_f_x"]
        lagrangian = self._lagrangian(x=w, p=p, lam_f=1.0, lam_g=result.lam_g)["grad_gamma_x"]
        slope = np.array(lagrangian).ravel() + result.lam_x
        sizes = (np.array(cost).ravel()[free], result.lam_g, result.lam_x[free])
        return OptimalityResidual(_largest(slope[free]), max(map(_largest, sizes)))

    def is_value(self, result: NlpResult, p: np.ndarray) -> bool:
        """Return whether cost and constraints are those of the unknowns.

        A backend that fails at once returns zeros for what it has not evaluated.
        """
        at = self._lagrangian(x=result.w, p=p, lam_f=1.0, lam_g=np.zeros_like(result.g))
        cost, g = float(at["f"]), np.array(at["g"]).ravel()
        is_cost = abs(cost - result.cost) <= _SAME * (1.0 + abs(cost))
        return bool(is_cost and (np.abs(g - result.g) <= _SAME * (1.0 + np.abs(g))).all())

    @cached_property
    def _cost(self) -> ca.Function:
        return self.function.get_function("nlp_grad_f")

    @cached_property
    def _lagrangian(self) -> ca.Function:
        return self.function.get_function("nlp_grad")


def _largest(values: np.ndarray) -> float:
    """Return the largest absolute value; inf where one is not finite."""
    largest = float(np.abs(values).max(initial=0.0))
    return largest if np.isfinite(largest) else np.inf
