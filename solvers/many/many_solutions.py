"""``ManySolutions``: the answers of many runs of one problem, as arrays."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ocp import ProblemError, Solution, Solver, Status, Work
from ocp.internal import MethodSolver, check_whole, judged
from solvers.many.questions import Questions


@dataclass(frozen=True, eq=False, repr=False)
class ManySolutions:
    """The answers of K runs, in the order in which they were asked.

    A status is what the solver says; ``solution`` also compares a success with the referee, as
    ``solve`` does. What was not done, for lack of time or after Ctrl-C, has the status
    ``TIME_LIMIT``, an infinite cost, and the start held. Answers that were found in C have no
    ``history``.

    Attributes:
        asked: the data of every run.
        solver: the method with its options.
        done: which came to an end, bool (K,).
        status: how each has ended, (K,).
        cost: as the solver computes it, (K,).
        residual: the solver's own measure of optimality, (K,).
        iterations: (K,).
        work: roll-outs, Jacobians and factorisations of each, (K, 3), see ``Work``.
        seconds: what each took [s], (K,).
        t: nodes [s], (K, N + 1).
        x: states, (K, N + 1, nx).
        u: controls as in ``Solution``, (K, N, nu) where held.
        costate: dJ*/dx, (K, N + 1, nx).
        build_time: of the solver, once [s].
        solve_time: of all runs, by the clock [s].
        threads: how many have worked.
        in_c: how many were solved together in C; the others one by one.
        by_run: the answers of these, by the number of the run.
    """

    asked: Questions
    solver: Solver
    done: np.ndarray
    status: tuple[Status, ...]
    cost: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    work: np.ndarray
    seconds: np.ndarray
    t: np.ndarray
    x: np.ndarray
    u: np.ndarray
    costate: np.ndarray
    build_time: float
    solve_time: float
    threads: int
    in_c: int
    by_run: Mapping[int, Solution] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return K."""
        return self.asked.count

    def __repr__(self) -> str:
        """Return one line: how many, how they ended, how long it took."""
        words = [f"{self.status.count(s)} {s.name}" for s in Status if s in self.status]
        return (
            f"<ManySolutions of '{self.asked.ocp.name}': {len(self)} runs, {', '.join(words)}, "
            f"{self.solve_time:.3g} s>"
        )

    @property
    def solved(self) -> np.ndarray:
        """Which are a success, bool (K,)."""
        return np.array([status.is_success for status in self.status])

    def solution(self, i: int) -> Solution:
        """Return the answer of run i as a ``Solution``, compared with the referee.

        Raises:
            ProblemError: if there is no such run, or it was not done.
        """
        check_whole(i, "solution: the number of the run", least=0)
        if i >= len(self):
            raise ProblemError(f"solution: there are runs 0 to {len(self) - 1}, but no {i}")
        if not self.done[i]:
            raise ProblemError(f"solution: run {i} was not done: time was up, or Ctrl-C came first")
        found = (self.by_run[i] if i in self.by_run else self._made(i)).with_(
            build_time=self.build_time
        )
        if not (isinstance(self.solver, MethodSolver) and self.solver.judged):
            return found
        return judged(found, self.solver.success_accuracy, slack=self.solver.end_slack)

    def _made(self, i: int) -> Solution:
        """Return an answer that was found in C."""
        data = self.asked.data(i)
        return Solution(
            problem=self.asked.ocp,
            solver=repr(self.solver),
            status=self.status[i],
            t=self.t[i].copy(),
            x=self.x[i].copy(),
            x0=data.x0,
            costate=self.costate[i].copy(),
            u=self.u[i].copy(),
            cost=float(self.cost[i]),
            residual=float(self.residual[i]),
            iterations=int(self.iterations[i]),
            work=Work(*self.work[i].tolist()),
            parameters=data.values.as_dict(),
            solve_time=float(self.seconds[i]),
        )
