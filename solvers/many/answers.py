"""``Answers``: the arrays of many answers while they are being found."""

from dataclasses import dataclass, field

import numpy as np

from ocp import ProblemError, Solution, Solver, Status
from solvers.many.many_solutions import ManySolutions
from solvers.many.questions import Questions

#: The arrays of a trajectory.
TRAJECTORY = ("t", "x", "u", "costate")


@dataclass(frozen=True, eq=False)
class Answers:
    """Arrays with a row for every run, see ``ManySolutions``; what is not done yet has a start.

    Attributes:
        asked: the data of every run.
        t: nodes [s], (K, N + 1).
        x: (K, N + 1, nx).
        u: (K, N, nu).
        costate: (K, N + 1, nx).
        status: (K,), of ``Status``.
        by_run: the solutions of single runs, by their number.
    """

    asked: Questions
    t: np.ndarray
    x: np.ndarray
    u: np.ndarray
    costate: np.ndarray
    status: np.ndarray
    done: np.ndarray
    cost: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    work: np.ndarray
    seconds: np.ndarray
    by_run: dict[int, Solution] = field(default_factory=dict)

    @classmethod
    def on(cls, asked: Questions, nodes: np.ndarray, controls: int) -> "Answers":
        """Return what is there before the first run: starts, on a grid.

        Args:
            asked: the data of every run.
            nodes: instants [s], (N + 1,).
            controls: rows of u.
        """
        count, m = asked.count, asked.ocp.model
        u = asked.ocp.control_bounds.clip(np.zeros((count, controls, m.nu)))
        x = np.repeat(asked.starts[:, None], len(nodes), axis=1)
        status = np.empty(count, dtype=object)
        status[:] = Status.TIME_LIMIT
        return cls(
            asked=asked,
            t=np.tile(nodes, (count, 1)),
            x=x,
            u=u,
            costate=np.zeros_like(x),
            status=status,
            done=np.zeros(count, dtype=bool),
            cost=np.full(count, np.inf),
            residual=np.full(count, np.inf),
            iterations=np.zeros(count, dtype=int),
            work=np.zeros((count, 3), dtype=int),
            seconds=np.zeros(count),
        )

    def put(self, i: int, found: Solution) -> None:
        """Take over the answer of a single run.

        Raises:
            ProblemError: if it is on another number of nodes than the others.
        """
        like = next(iter(self.by_run.values()), found)
        for name in TRAJECTORY:
            here, there = getattr(found, name).shape, getattr(like, name).shape
            if here != there:
                raise ProblemError(
                    f"solve_many: {name} of run {i} has shape {here}, and {there} in runs before: "
                    "a solver that chooses its grid is to be run one by one"
                )
        self.by_run[i] = found
        work = found.work
        self.work[i] = work.rollouts, work.jacobians, work.factorisations
        self.status[i], self.done[i] = found.status, True
        self.cost[i], self.residual[i] = found.cost, found.residual
        self.iterations[i], self.seconds[i] = found.iterations, found.solve_time

    def _trajectories(self) -> dict[str, np.ndarray]:
        """Return t, x, u and costate of all runs, on the grid of those that are done."""
        arrays = {name: getattr(self, name) for name in TRAJECTORY}
        for i, found in self.by_run.items():
            for name, rows in arrays.items():
                own = getattr(found, name)
                if rows.shape[1:] != own.shape:  # nobody knew it before the first answer
                    arrays[name] = rows = self._held(name, found)
                rows[i] = own
        return arrays

    def _held(self, name: str, like: Solution) -> np.ndarray:
        """Return what is said of runs that are not done, on the grid of one that is."""
        own, count = getattr(like, name), self.asked.count
        if name == "t":
            return np.tile(own, (count, 1))
        if name == "x":
            return np.repeat(self.asked.starts[:, None], len(own), axis=1)
        return np.zeros((count, *own.shape))

    def collected(
        self, solver: Solver, build_time: float, solve_time: float, threads: int
    ) -> ManySolutions:
        """Return them as the answer of ``solve_many``."""
        names = ("done", "cost", "residual", "iterations", "work", "seconds")
        return ManySolutions(
            asked=self.asked,
            solver=solver,
            status=tuple(self.status),
            **self._trajectories(),
            **{name: getattr(self, name) for name in names},
            by_run=dict(self.by_run),
            in_c=int(np.count_nonzero(self.done)) - len(self.by_run),
            build_time=build_time,
            solve_time=solve_time,
            threads=threads,
        )
