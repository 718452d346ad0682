"""``solve_many``: many starts, parameters or guesses of one problem at once."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, InitialGuess, Interrupted, Program, Progress, Solver
from ocp.internal import check_instance, check_positive, check_whole, told
from solvers.many.answers import Answers
from solvers.many.in_c import InC
from solvers.many.many_solutions import ManySolutions
from solvers.many.questions import Questions


def solve_many(
    ocp: OCP,
    solver: Solver,
    *,
    x0: ArrayLike | None = None,
    t0: float = 0.0,
    parameters: Mapping[str, ArrayLike] | None = None,
    guesses: Sequence[InitialGuess | None] | InitialGuess | None = None,
    threads: int | None = None,
    time_limit: float = np.inf,
    progress: Progress | None = None,
) -> ManySolutions:
    """Solve one problem for many starts, parameters or guesses; it is built once.

    The answers are those of ``solver.build(ocp).run(x0=x0[i], ...)``, one after the other, but
    compared with the referee only when ``ManySolutions.solution`` is asked for one. With
    ``MultipleShooting(backend="native")``, where the start is given and nothing has to be rewritten
    but the units, all runs are solved in C, on several threads. Those whose answer
    needs more (a failure, an inaccurate one, a control that stands still) are run one by one after
    that, and so are all runs of other solvers. The answers are the same for any number of threads.

    Args:
        ocp: the problem.
        solver: the method with its options.
        x0: starts (K, nx); default: the problem's for all.
        t0: initial time of all [s].
        parameters: by name, what ``run`` takes with an axis of K in front: (K, m) or (K,) of a
            parameter, (K, N + 1, m) of a signal.
        guesses: a list of K, in which None is the problem's own, or one for all.
        threads: in C; default: the processors that this process may use.
        time_limit: for all runs [s]; what is not done then has the status ``TIME_LIMIT``.
        progress: told now and then how many are done.

    Returns:
        the answers as arrays, and each as a ``Solution`` when asked for.

    Raises:
        ProblemError: if an argument does not fit, saying of which run.
        UnsupportedProblem: where the method cannot treat the problem, naming the term.
        Interrupted: on Ctrl-C; its ``so_far`` are ``ManySolutions`` in which ``done`` says which
            there are.
    """
    check_instance(ocp, OCP, "solve_many: ocp")
    check_instance(solver, Solver, "solve_many: solver")
    workers = _processors() if threads is None else check_whole(threads, "solve_many: threads")
    check_positive(time_limit, "solve_many: time_limit [s]", finite=False)
    asked = Questions.of(ocp, x0, t0, parameters, guesses)
    report = told(progress, "solve_many")
    started = perf_counter()
    program = solver.unjudged().build(ocp)
    built = perf_counter()
    many = _Many(program, InC.of(program), asked, workers, built + time_limit, report)
    answers = many.empty()
    try:
        many.solve(answers)
    except KeyboardInterrupt:
        times = built - started, perf_counter() - built
        raise Interrupted("solve_many", answers.collected(solver, *times, workers)) from None
    return answers.collected(solver, built - started, perf_counter() - built, workers)


@dataclass(frozen=True, eq=False)
class _Many:
    """The runs of one program, on their way.

    Attributes:
        program: of the solver.
        in_c: what solves together; None: nothing.
        asked: the data of every run.
        threads: how many work in C.
        deadline: when to stop, by ``perf_counter`` [s].
        report: is told how many are done.
    """

    program: Program
    in_c: InC | None
    asked: Questions
    threads: int
    deadline: float
    report: Progress

    def empty(self) -> Answers:
        """Return arrays for the answers; without C the first answer says how large they are."""
        if self.in_c is not None:
            return self.in_c.empty(self.asked)
        ends = self.asked.t0 + np.array([0.0, self.asked.ocp.duration])
        return Answers.on(self.asked, ends, 1)

    def solve(self, answers: Answers) -> None:
        """Solve until all is done or time is up."""
        left, count = np.ones(self.asked.count, dtype=bool), self.asked.count
        self.report(0, count)
        if self.in_c is not None:
            left = self.in_c.solve(answers, min(self.threads, count), self._watch)
        for i in np.flatnonzero(left).tolist():
            if self._is_late():
                break
            found = self.program.run(
                x0=self.asked.starts[i],
                t0=self.asked.t0,
                parameters=self.asked.values(i),
                guess=self.asked.guess(i),
            )
            answers.put(i, found)
            self.report(int(np.count_nonzero(answers.done)), count)
        self.report(int(np.count_nonzero(answers.done)), count)

    def _watch(self, done: int) -> bool:
        """Tell how many are done; return whether time is up."""
        self.report(done, self.asked.count)
        return self._is_late()

    def _is_late(self) -> bool:
        return perf_counter() >= self.deadline


def _processors() -> int:
    """Return how many this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
