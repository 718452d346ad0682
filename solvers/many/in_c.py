"""Runs of one problem solved together in C, where the native backend takes it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ocp import OCP, InitialGuess, Program, Status
from ocp.internal import InSizes, RewrittenProgram, interruptible
from solvers.direct.first_trajectory import first_duration
from solvers.direct.multiple_shooting import MultipleShootingProgram
from solvers.direct.native.native_batch import NativeBatch, NativeSolves
from solvers.many.answers import Answers
from solvers.many.questions import Questions


@dataclass(frozen=True, eq=False)
class InC:
    """The native solver of a problem, which may be written in sizes of its own.

    Attributes:
        batch: solves in C.
        x_size: what states are measured in there, (nx,).
        u_size: controls, (nu,).
        cost_size: the cost.
    """

    batch: NativeBatch
    x_size: np.ndarray
    u_size: np.ndarray
    cost_size: float

    @classmethod
    def of(cls, program: Program) -> "InC | None":
        """Return what solves a program's runs together; None: they run one by one."""
        sizes = None
        if isinstance(program, RewrittenProgram) and isinstance(program.rewriting, InSizes):
            sizes, program = program.rewriting.scaled.sizes, program.program
        if not isinstance(program, MultipleShootingProgram) or program.native_batch is None:
            return None
        if sizes is None:
            m = program.ocp.model
            return cls(program.native_batch, np.ones(m.nx), np.ones(m.nu), 1.0)
        return cls(program.native_batch, sizes.x, sizes.u, float(sizes.cost))

    def empty(self, asked: Questions) -> Answers:
        """Return arrays for the answers."""
        fractions = self.batch.transcription.fractions
        return Answers.on(asked, asked.t0 + fractions * asked.ocp.duration, len(fractions) - 1)

    def solve(self, answers: Answers, threads: int, watch: Callable[[int], bool]) -> np.ndarray:
        """Solve all; write what needs nothing else into the answers, also when stopped.

        Returns:
            which came to an end that needs more, bool (K,).
        """
        many = self._solves(answers.asked)
        try:
            self.batch.solve(many, threads, watch)
        finally:
            clean = self.batch.clean(many, answers.asked.t0)
            self._put(answers, many, clean)
        return many.done & ~clean

    def _put(self, answers: Answers, many: NativeSolves, clean: np.ndarray) -> None:
        tr = self.batch.transcription
        nx, ocp = tr.ocp.model.nx, answers.asked.ocp
        if ocp.has_free_time:
            durations = tr.time_unit * many.x[clean, -1, nx]
            answers.t[clean] = answers.asked.t0 + durations[:, None] * tr.fractions
        answers.x[clean] = many.x[clean, :, :nx] * self.x_size
        answers.x[clean, 0] = answers.asked.starts[clean]  # without the rounding of the sizes
        answers.u[clean] = many.u[clean] * self.u_size
        answers.costate[clean] = many.costate[clean, :, :nx] * (self.cost_size / self.x_size)
        answers.cost[clean] = many.reported("cost")[clean] * self.cost_size
        answers.residual[clean] = many.reported("dual")[clean]
        answers.iterations[clean] = many.reported("iterations")[clean]
        answers.seconds[clean] = many.reported("seconds")[clean]
        evaluations = many.reported("evaluations")
        rollouts = many.reported("values") + evaluations
        work = [rollouts, evaluations, many.reported("factorisations")]
        answers.work[clean] = np.column_stack(work)[clean]
        answers.status[clean], answers.done[clean] = Status.SOLVED, True

    @interruptible
    def _solves(self, asked: Questions) -> NativeSolves:
        """Return first iterates and data of all runs, in sizes."""
        tr = self.batch.transcription
        count, n, m = asked.count, tr.n, tr.ocp.model
        x = np.repeat(asked.starts[:, None], n + 1, axis=1)
        u, costate = np.zeros((count, n, m.nu)), np.zeros((count, n + 1, tr.nz))
        has_states, is_warm = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        durations = np.full(count, asked.ocp.duration)
        for at, guess in self._by_guess(asked):
            read = _Read.of(asked.ocp, guess, tr.fractions)
            durations[at] = first_duration(asked.ocp, guess)
            u[at] = 0.0 if read.u is None else read.u
            if read.x is not None:
                x[at, 1:], has_states[at] = read.x[1:], True
                is_warm[at] = read.costate is not None
                costate[at, :, : m.nx] = 0.0 if read.costate is None else read.costate
        x /= self.x_size
        durations = asked.ocp.time_box.clip(durations)
        if tr.ocp.has_free_time:
            times = np.repeat(durations[:, None, None] / tr.time_unit, n + 1, axis=1)
            x = np.concatenate([x, times], axis=2)
        u = tr.ocp.control_bounds.clip(u / self.u_size)
        costate[..., : m.nx] *= self.x_size / self.cost_size
        return NativeSolves(x, u, costate, has_states, is_warm, self._data(asked))

    def _by_guess(self, asked: Questions) -> "list[tuple[slice | int, InitialGuess]]":
        """Return which runs start from which guess; those without one are left out."""
        if len(asked.guesses) == 1:
            first = asked.guesses[0]
            return [] if first is None else [(slice(None), first)]
        return [(i, guess) for i, guess in enumerate(asked.guesses) if guess is not None]

    def _data(self, asked: Questions) -> np.ndarray:
        """Return the data of the nodes; one for all where nothing differs."""
        count = asked.count if asked.parameters else 1
        return self.batch.data([asked.data(i) for i in range(count)])


@dataclass(frozen=True, eq=False)
class _Read:
    """What a guess says at the nodes, or None."""

    x: np.ndarray | None
    u: np.ndarray | None
    costate: np.ndarray | None

    @classmethod
    def of(cls, ocp: OCP, guess: InitialGuess, nodes: np.ndarray) -> "_Read":
        nx, nu = ocp.model.nx, ocp.model.nu
        return cls(
            guess.sample("x", nodes, nx),
            guess.sample("u", nodes[:-1], nu),
            guess.sample("costate", nodes, nx),
        )
