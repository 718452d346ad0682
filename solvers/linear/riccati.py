"""Dynamic programming for linear-quadratic problems: Riccati's recursion."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from ocp import (
    OCP,
    InitialGuess,
    Status,
    Work,
    linear_quadratic,
    with_stationary_end,
)
from ocp.internal import (
    LinearQuadratic,
    MethodProgram,
    MethodSolver,
    RunData,
    RunResult,
    check_choice,
)
from solvers.linear import regulator_gains as recursion


@dataclass(frozen=True)
class Riccati(MethodSolver):
    r"""Riccati's recursion: feedback gains and costs-to-go of a linear-quadratic problem.

    .. math:: u_k = -K_kx_k - k_k, \qquad J_k^*(x) = x'P_kx + 2p_k'x + \text{const}, \qquad
              \lambda_k = 2(P_kx_k + p_k)

    Source: thesis (2.47), (2.48), with references, affine dynamics, cross terms and data that
    change with time. Effort linear in the number of steps. Refuses bounds and constraints.

    Args:
        horizon: ``"finite"``: the problem as it stands; ``"infinite"``: its terminal cost is
            replaced by the cost of going on for ever (``with_stationary_end``), so that every
            gain is the stationary one.
    """

    horizon: Literal["finite", "infinite"] = "finite"

    def __post_init__(self) -> None:
        """Check the option."""
        super().__post_init__()
        check_choice(self.horizon, ("finite", "infinite"), "Riccati: horizon")

    def prepare(self, ocp: OCP) -> "RiccatiProgram":
        """Read the matrices; where they are constant, do the recursion."""
        problem = with_stationary_end(ocp) if self.horizon == "infinite" else ocp
        lq = linear_quadratic(problem)
        recursion.refuse_constraints(lq, "Riccati")
        fixed = None if lq.fixed is None else recursion.regulator_gains(lq.fixed)
        return RiccatiProgram(self, lq.ocp, lq, fixed)


@dataclass(frozen=True, eq=False)
class RiccatiProgram(MethodProgram):
    """A problem whose gains are known.

    Attributes:
        lq: the problem as arrays.
        fixed_gains: the gains, where neither time nor parameters change them.
    """

    solver: Riccati
    lq: LinearQuadratic
    fixed_gains: recursion.RegulatorGains | None

    @property
    def P(self) -> np.ndarray:
        """Costs-to-go P_k with the declared parameters, (N + 1, n, n)."""
        return self._declared.P

    @property
    def K(self) -> np.ndarray:
        """Gains K_k with the declared parameters, (N, m, n)."""
        return self._declared.K

    @cached_property
    def k(self) -> np.ndarray:
        """Feed-forward k_k of u = -K x - k with the declared parameters, (N, m)."""
        return recursion.affine_parts(self._declared, self.lq.on(self.lq.declared))[1]

    @cached_property
    def _declared(self) -> recursion.RegulatorGains:
        return self.fixed_gains or recursion.regulator_gains(self.lq.on(self.lq.declared).matrices)

    def _solve(self, data: RunData, guess: InitialGuess | None) -> RunResult:
        """Solve for these data; a guess is not needed."""
        numbers = self.lq.on(data)
        gains = self.fixed_gains or recursion.regulator_gains(numbers.matrices)
        p, k = recursion.affine_parts(gains, numbers)
        x, u = recursion.closed_loop_rollout(numbers, data.x0, gains.K, -k)
        half = recursion.half_slopes(numbers, x, u)
        return RunResult(
            status=Status.SOLVED,
            t=data.t0 + self.lq.nodes,
            x=x,
            u=u,
            costate=2.0 * (np.einsum("kij,kj->ki", gains.P, x) + p),
            cost=recursion.cost(numbers, x, u, half),
            iterations=1,
            work=Work(rollouts=1, factorisations=self.lq.steps),
        )
