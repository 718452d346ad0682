"""How well an answer meets the first-order conditions, judged without the backend's scaling."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from solvers.direct.nlp_backends import NlpResult

_TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class OptimalityResidual:
    """Residuals of the first-order conditions, none of them scaled by a backend.

    Attributes:
        gradient: largest entry of the Lagrangian's gradient, among the unknowns that are free.
        multiplier: largest entry of the cost's gradient and of all multipliers.
        complementarity: largest product of a multiplier and the distance from its bound.
        cost: size of the cost.
    """

    gradient: float
    multiplier: float
    complementarity: float
    cost: float

    @property
    def relative(self) -> float:
        """Gradient relative to the multipliers or complementarity to the cost: the larger one."""
        return max(
            _share(self.gradient, self.multiplier), _share(self.complementarity, self.cost)
        )

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
        """Return the residuals of a result; inf where a derivative is not finite.

        Args:
            result: with its multipliers.
            p: data of the problem.
            bounds: lbx, ubx, lbg, ubg.
        """
        w, free = result.w, bounds["lbx"] < bounds["ubx"]
        of_cost = np.array(self._cost_gradient(x=w, p=p)["grad_f_x"]).ravel()
        of_lagrangian = np.array(self._lagrangian_gradient(x=w, p=p, lam_f=1.0, lam_g=result.lam_g)["grad_gamma_x"]).ravel()
        slope = (of_lagrangian + result.lam_x)[free]
        sizes = (of_cost[free], result.lam_g, result.lam_x[free])
        return OptimalityResidual(
            gradient=_largest(slope),
            multiplier=max(map(_largest, sizes)),
            complementarity=max(
                _complementarity(w[free], result.lam_x[free], bounds["lbx"][free], bounds["ubx"][free]),
                _complementarity(result.g, result.lam_g, bounds["lbg"], bounds["ubg"]),
            ),
            cost=abs(result.cost) + _largest(of_cost[free] * w[free]),
        )

    @cached_property
    def _cost_gradient(self) -> ca.Function:
        return self.function.get_function("nlp_grad_f")

    @cached_property
    def _lagrangian_gradient(self) -> ca.Function:
        return self.function.get_function("nlp_grad")


def _share(part: float, size: float) -> float:
    return part / max(size, _TINY) if np.isfinite(part) else np.inf


def _largest(values: np.ndarray) -> float:
    """Return the largest absolute value; inf where one is not finite."""
    largest = float(np.abs(values).max(initial=0.0))
    return largest if np.isfinite(largest) else np.inf


def _complementarity(
    value: np.ndarray, multiplier: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> float:
    """Return the largest product of a multiplier with the distance from the bound it belongs to."""
    bound = np.where(multiplier > 0.0, upper, lower)
    at = np.isfinite(bound) & (lower < upper)
    return _largest(multiplier[at] * (value[at] - bound[at]))
