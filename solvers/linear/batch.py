"""The batch approach: all inputs of a linear-quadratic problem from one linear system."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from ocp import OCP, InitialGuess, Status, Work, linear_quadratic
from ocp.internal import (
    LinearQuadratic,
    LQData,
    Matrices,
    MethodProgram,
    MethodSolver,
    RunData,
    RunResult,
    check_flag,
)
from solvers.linear import regulator_gains as recursion
from solvers.linear.stacked_prediction import StackedPrediction

# Above this condition number of H the inputs have fewer than about eight correct digits.
_ILL_CONDITIONED = 1e8


@dataclass(frozen=True)
class Batch(MethodSolver):
    r"""Stack all states over all inputs, and set the gradient of the cost to zero.

    .. math:: U^* = -H^{-1}(F'x_0 - k')

    Source: thesis (2.4) to (2.21), with references, affine dynamics, cross terms and data that
    change with time. Refuses bounds and constraints. The inputs that are stacked are those of
    u = -Kx + v, with the gain of the infinite horizon: exact on unstable plants as well.

    Args:
        prestabilise: False: the thesis' plain form, K = 0. On an unstable plant H then loses
            all digits with the length of the horizon; the answer is ``FAILED`` and says so.
    """

    prestabilise: bool = True

    def __post_init__(self) -> None:
        """Check the option."""
        super().__post_init__()
        check_flag(self.prestabilise, "Batch: prestabilise")

    def prepare(self, ocp: OCP) -> "BatchProgram":
        """Stack and factorise."""
        lq = linear_quadratic(ocp)
        recursion.refuse_constraints(lq, "Batch")
        fixed = None if lq.fixed is None else _stacked(self, ocp, lq.fixed)
        return BatchProgram(self, ocp, lq, fixed)


@dataclass(frozen=True, eq=False)
class _Stacked:
    """A prediction with its factorised Hessian; None where it is not positive definite."""

    prediction: StackedPrediction
    factor: tuple[np.ndarray, bool] | None


def _stacked(solver: Batch, ocp: OCP, matrices: Matrices) -> _Stacked:
    steps, n, m = matrices.B.shape
    feedback = np.zeros((steps, m, n))
    if solver.prestabilise:
        feedback = recursion.stabilising(matrices, ocp.name)
    prediction = StackedPrediction.of(matrices, feedback)
    try:
        return _Stacked(prediction, cho_factor(prediction.hessian))
    except (LinAlgError, ValueError):  # not positive definite, or not finite
        return _Stacked(prediction, None)


class _Minimiser(NamedTuple):
    """States (N + 1, n) and inputs (N, m) of the linear system, and how sound they are."""

    x: np.ndarray
    u: np.ndarray
    status: Status
    message: str


@dataclass(frozen=True, eq=False)
class BatchProgram(MethodProgram):
    """A stacked problem.

    Attributes:
        lq: the problem as arrays.
        fixed: the stacked matrices, where neither time nor parameters change them.
    """

    solver: Batch
    lq: LinearQuadratic
    fixed: _Stacked | None

    @property
    def prediction(self) -> StackedPrediction:
        """The stacked matrices with the declared parameters."""
        stacked = self.fixed or _stacked(
            self.solver, self.ocp, self.lq.on(self.lq.declared).matrices
        )
        return stacked.prediction

    def _solve(self, data: RunData, guess: InitialGuess | None) -> RunResult:
        """Solve for these data; a guess is not needed."""
        numbers = self.lq.on(data)
        stacked = self.fixed or _stacked(self.solver, self.ocp, numbers.matrices)
        x, u, status, message = self._minimiser(stacked, numbers, data.x0)
        n, m = x.shape[1], numbers.matrices
        half = recursion.half_slopes(numbers, x, u)
        by_x, by_u = 2.0 * half[:, :n], 2.0 * half[:, n:]
        final = 2.0 * (m.P @ x[-1] + numbers.p)
        costate = stacked.prediction.costates(by_x, by_u, final)
        h_u = by_u + (costate[1:, None] @ m.B)[:, 0]
        finite = status is not Status.DIVERGED and bool(np.isfinite(costate).all())
        return RunResult(
            status=status,
            message=message,
            t=data.t0 + self.lq.nodes,
            x=x,
            u=u,
            costate=costate if finite else np.zeros_like(x),
            cost=recursion.cost(numbers, x, u, half) if finite else np.inf,
            residual=float(np.abs(h_u).max()) if finite else np.inf,
            iterations=1,
            work=Work(rollouts=1, factorisations=1),
        )

    def _minimiser(self, stacked: _Stacked, data: LQData, x0: np.ndarray) -> _Minimiser:
        prediction = stacked.prediction
        with np.errstate(over="ignore", invalid="ignore"):
            gradient = prediction.gradient(data, *prediction.nominal(data, x0))
        advice = "" if self.solver.prestabilise else ": prestabilise"
        said = f"H has the condition number {prediction.condition:.2g}{advice}"
        if stacked.factor is None or not np.isfinite(gradient).all():
            nothing = np.zeros((self.lq.steps, data.r.shape[1]))
            still = np.tile(x0, (len(nothing) + 1, 1))
            return _Minimiser(still, nothing, Status.DIVERGED, said)
        x, u = prediction.trajectory(data, x0, -cho_solve(stacked.factor, gradient))
        if prediction.condition > _ILL_CONDITIONED:
            return _Minimiser(x, u, Status.FAILED, said)
        return _Minimiser(x, u, Status.SOLVED, "")
