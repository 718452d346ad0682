"""Implicit one-step methods, for dynamics that are stiff."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks.errors import ProblemError
from ocp.expressions.equations import solve_equations
from ocp.integration.one_step import Integrator, Rate

_MOST_STAGES = 5


@dataclass(frozen=True)
class Radau(Integrator):
    r"""Radau IIA, collocation at Radau's points inside each substep: for stiff dynamics.

    .. math:: Z_i = z + h \sum_j a_{ij} \, g(Z_j, s + c_j h), \qquad z(s + h) = Z_m

    It damps whatever is fast, at any step (L-stable), and has order 2 m - 1 for m stages; one stage
    is the implicit Euler method. The stages are solved for inside each step, linear dynamics as an
    expression, others by Newton's method, with exact derivatives of what it finds; where it finds
    nothing, the step is NaN. Source: [Hairer & Wanner 1996, IV.5].

    For methods that integrate from node to node: ``MultipleShooting``, ``Schuetz``, ``GridDP`` and
    ``Greedy``. ``Collocation`` needs none, it is this method with the stages as unknowns.

    Args:
        steps: equal substeps in each interval.
        stages: m, 1 to 5.

    Raises:
        ProblemError: if there are other numbers of stages.
    """

    stages: int = 3

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
        if self.stages not in range(1, _MOST_STAGES + 1):
            raise ProblemError(f"Radau: stages = {self.stages!r}, it is 1 to {_MOST_STAGES}")

    @property
    def order(self) -> int:
        """2 m - 1."""
        return 2 * self.stages - 1

    @property
    def points(self) -> np.ndarray:
        """c, in (0, 1], (m,)."""
        return np.array(ca.collocation_points(self.stages, "radau"))

    @property
    def weights(self) -> np.ndarray:
        """a, so that polynomials of degree m - 1 are integrated exactly to every point, (m, m)."""
        c, powers = self.points[:, None], np.arange(self.stages)
        return (c ** (powers + 1) / (powers + 1)) @ np.linalg.inv(c**powers)

    def substep(self, rate: Rate, z: ca.SX, s: ca.SX | float, h: ca.SX | float) -> ca.SX:
        """Return the last stage."""
        c, a = self.points, self.weights
        begin = ca.SX.sym("begin", z.numel())
        stages = [ca.SX.sym(f"stage {i}", z.numel()) for i in range(self.stages)]
        slopes = [rate(stage, s + c[i] * h) for i, stage in enumerate(stages)]
        g = [
            stage - begin - h * sum(a[i, j] * slope for j, slope in enumerate(slopes))
            for i, stage in enumerate(stages)
        ]
        start = ca.repmat(begin, self.stages)
        found = solve_equations(ca.vertcat(*g), ca.vertcat(*stages), start).values
        return ca.substitute(found[-z.numel() :], begin, z)
