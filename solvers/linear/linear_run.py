"""One run of a linear solver: the numbers it starts from, and the solution it ends with."""

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ocp import Solution, Status, Work
from ocp.internal import LinearQuadratic, LQData, RunData


@dataclass(frozen=True, eq=False)
class LinearRun:
    """What every run of a linear-quadratic problem has in common.

    Attributes:
        lq: the problem as arrays.
        data: what the run adds to it.
        numbers: the arrays for these data.
        started: when, by the clock [s].
    """

    lq: LinearQuadratic
    data: RunData
    numbers: LQData
    started: float

    @classmethod
    def of(
        cls,
        lq: LinearQuadratic,
        x0: ArrayLike | None,
        t0: float,
        parameters: Mapping[str, ArrayLike] | None,
    ) -> "LinearRun":
        """Start the clock, check the data and sample the arrays.

        Raises:
            ProblemError: if the data do not fit the problem, or make a weight indefinite.
        """
        started = perf_counter()
        data = RunData.of(lq.ocp, x0, t0, parameters)
        return cls(lq, data, lq.on(data), started)

    def solution(
        self,
        solver: str,
        *,
        x: np.ndarray,
        u: np.ndarray,
        costate: np.ndarray,
        cost: float,
        factorisations: int,
        status: Status = Status.SOLVED,
        message: str = "",
        residual: float = 0.0,
        iterations: int = 1,
        history: Mapping[str, np.ndarray] | None = None,
    ) -> Solution:
        """Return what was found, with the data of this run and the time it took."""
        return Solution(
            problem=self.lq.ocp,
            solver=solver,
            status=status,
            message=message,
            t=self.data.t0 + self.lq.nodes,
            x=x,
            x0=self.data.x0,
            costate=costate,
            u=u,
            cost=cost,
            residual=residual,
            iterations=iterations,
            work=Work(rollouts=1, factorisations=factorisations),
            history=history or {},
            parameters=self.data.values.as_dict(),
            solve_time=perf_counter() - self.started,
        )
