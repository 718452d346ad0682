"""Direct multiple shooting: the problem on a grid, solved by an interior-point method."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ocp import (
    OCP,
    RK4,
    Box,
    Data,
    Integrator,
    ProblemError,
    Program,
    Row,
    Solution,
    Solver,
    Start,
    Status,
    Transcription,
    Work,
    instance,
    whole,
)
from solvers.direct.backend import Answer, Backend, Nlp
from solvers.direct.feasibility import Feasibility
from solvers.direct.intervals import Intervals

# Beyond this a constraint counts as violated, whatever the backend says about scaled ones.
_VIOLATED = 1e-6
# How far a backend that did not move is pushed, relative to 1 + abs(u).
_KICK = 1e-3
# What counts as not moving, by the same measure.
_SAME = 1e-6
# What the elastic problem leaves over beyond its own tolerance.
_UNAVOIDABLE = 1e-5


@dataclass(frozen=True)
class MultipleShooting(Solver):
    """The direct baseline: everything that a problem can say.

    Source: [Bock & Plitt 1984]; backends [Waechter & Biegler 2006], [Vanroye et al. 2023].

    Args:
        intervals: number of intervals, with one held control each; a discrete-time problem
            brings its own number.
        integrator: one-step method in each interval.
        backend: ``"ipopt"``, or ``"fatrop"``, which exploits the stages.
        tolerance: of the optimality conditions.
        max_iterations: limit of the backend.
        accuracy: largest accepted change of a state, relative to 1 + abs(x), when the step of an
            interval is halved; an answer beyond it is ``INACCURATE``.
        verbose: let the backend print.
        compiled: run the stages as machine code; the first build takes seconds, see ``compiled``.
    """

    intervals: int = 75
    integrator: Integrator = field(default_factory=RK4)
    backend: Literal["ipopt", "fatrop"] = "ipopt"
    tolerance: float = 1e-9
    max_iterations: int = 300
    accuracy: float = 1e-2
    verbose: bool = False
    compiled: bool = False

    def __post_init__(self) -> None:
        """Check the options."""
        whole(self.intervals, "multiple shooting: intervals")
        instance(self.integrator, Integrator, "multiple shooting: integrator")
        if not self.accuracy > 0.0:
            raise ProblemError(f"the accuracy must be positive, not {self.accuracy}")
        self.options  # noqa: B018 - checks its own

    @property
    def options(self) -> Backend:
        """The backend with its options."""
        return Backend(self.backend, self.tolerance, self.max_iterations, self.verbose)

    def build(self, ocp: OCP) -> "MultipleShootingProgram":
        """Transcribe the problem and set the backend up."""
        transcription = Transcription(ocp, self.intervals, self.integrator, self.compiled)
        nlp = self.options.build(transcription)
        intervals = Intervals.of(ocp, transcription.n, self.integrator, fast=self.compiled)
        return MultipleShootingProgram(self, transcription, nlp, intervals)


@dataclass(frozen=True, eq=False)
class MultipleShootingProgram(Program):
    """A transcribed problem with its backend.

    Attributes:
        solver: the options.
        transcription: the problem on its grid.
        nlp: the backend.
        intervals: for first guesses, and to check the integrator.
    """

    solver: MultipleShooting
    transcription: Transcription
    nlp: Nlp
    intervals: Intervals

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: Start | None = None,
    ) -> Solution:
        """Solve for these data; where that fails, look for a trajectory that is feasible."""
        started = perf_counter()
        ocp, tr = self.transcription.ocp, self.transcription
        data = Data.of(ocp, x0, t0, parameters)
        bounds, p = tr.bounds(data), tr.data_vector(data)
        z, u = self._first_iterate(data, guess or ocp.guess)
        w0 = np.clip(tr.join(z, u), bounds["lbx"], bounds["ubx"])
        answers = [self.nlp.solve(w0, p, bounds)]
        status, message = self._verdict(answers[-1], data, bounds)
        if status is Status.SOLVED and not self._moved(w0, answers[-1]):
            # A backend looks at curvature only where it goes: one that stays on its first
            # controls takes a maximum or a saddle there for a solution. From a minimum the
            # second run comes back at once.
            answers.append(self.nlp.solve(self._kicked(answers[-1], bounds), p, bounds))
            status, message = self._verdict(answers[-1], data, bounds)
        if status in _MAYBE_INFEASIBLE and (ocp.constraints or ocp.state_bounds.is_active):
            found = self._feasibility.least_violating(w0, bounds, p)
            if found:
                answers.append(found[0])
                status, message = Status.INFEASIBLE, self._where(found[0], data, *found[1:])
            if found and found[1] <= _UNAVOIDABLE:
                answers.append(self.nlp.solve(found[0].w, p, bounds))
                status, message = self._verdict(answers[-1], data, bounds)
        return self._solution(data, answers, status, message, perf_counter() - started)

    @cached_property
    def _feasibility(self) -> Feasibility:
        return Feasibility(self.transcription)

    def _moved(self, w0: np.ndarray, answer: Answer) -> bool:
        """Whether any control differs from the first iterate's."""
        before, after = self.transcription.split(w0)[1], self.transcription.split(answer.w)[1]
        return bool(np.any(np.abs(after - before) > _SAME * (1.0 + np.abs(before))))

    def _kicked(self, answer: Answer, bounds: dict[str, np.ndarray]) -> np.ndarray:
        """Return the unknowns with slightly different controls; the same for the same answer."""
        z, u = self.transcription.split(answer.w)
        u = u + _KICK * np.random.default_rng(0).normal(size=u.shape) * (1.0 + np.abs(u))
        return np.clip(self.transcription.join(z, u), bounds["lbx"], bounds["ubx"])

    # -- the first iterate -------------------------------------------------------------------

    def _first_iterate(self, data: Data, guess: Start | None) -> tuple[np.ndarray, np.ndarray]:
        """States and controls of the guess, a free final time with the states."""
        tr, ocp = self.transcription, self.transcription.ocp
        duration = (guess.duration if guess and ocp.has_free_time else None) or ocp.duration
        x, u = self.intervals.first_iterate(data, guess, duration)
        z = np.hstack([x, np.full((tr.n + 1, 1), duration)]) if ocp.has_free_time else x
        return z, u

    # -- the verdict -------------------------------------------------------------------------

    def _verdict(
        self, answer: Answer, data: Data, bounds: dict[str, np.ndarray]
    ) -> tuple[Status, str]:
        """Status from the backend's word, the constraints themselves and the integrator."""
        if not np.isfinite(answer.cost):
            return Status.DIVERGED, f"the backend met a number that is not finite ({answer.word})"
        violation, row = self.transcription.worst(answer.w, answer.g, bounds)
        violated = violation > _VIOLATED
        where = self._where(answer, data, violation, row) if violated else ""
        if answer.success and not violated:
            excess, row = self._start_violation(answer)
            if excess > _VIOLATED:
                where = self._where(answer, data, excess, row)
                return Status.INFEASIBLE, f"{where}, by the given start itself"
            error, node = self._integration_error(answer, data)
            if error <= self.solver.accuracy:
                return Status.SOLVED, ""
            t = self._times(answer, data)[node]
            return Status.INACCURATE, f"a state moves by {error:.2g} at t = {t:.4g} s"
        if answer.count >= self.solver.max_iterations:
            return Status.ITERATION_LIMIT, where
        if answer.word == "Diverging_Iterates":
            return Status.DIVERGED, where or "the cost may be unbounded below"
        return Status.FAILED, f"{self.solver.backend} says {answer.word}. {where}".strip()

    def _start_violation(self, answer: Answer) -> tuple[float, Row | None]:
        """By how much the given start itself violates what is not imposed there, and what."""
        tr, ocp = self.transcription, self.transcription.ocp
        found: list[tuple[float, Row]] = []
        bounds = ocp.state_bounds.excess(answer.w[: ocp.model.nx])
        for name, excess in zip(ocp.model.x_names, bounds, strict=True):
            found.append((float(excess), Row(f"bound of {name}", "path", 0, 0.0, 0.0)))
        here = [i for i, row in enumerate(tr.rows) if row.place == "path" and row.node == 0]
        path = Box(
            *(
                np.concatenate([[], *[getattr(c, side) for c in ocp.at("path")]])
                for side in ("lower", "upper")
            )
        )
        for i, excess in zip(here, path.excess(answer.g[here]), strict=True):
            found.append((float(excess), tr.rows[i]))
        return max(found, key=lambda pair: pair[0])

    def _integration_error(self, answer: Answer, data: Data) -> tuple[float, int]:
        """By how much half the step moves the end of an interval, relative to 1 + abs(x)."""
        z, u = self.transcription.split(answer.w)
        x = z[:, : self.transcription.ocp.model.nx]
        return self.intervals.error(x, u, self.intervals.schedule(data, self._duration(answer)))

    def _where(self, answer: Answer, data: Data, violation: float, row: Row | None) -> str:
        if row is None:
            return ""
        t = self._times(answer, data)[row.node]
        return f"'{row.name}' is violated by {violation:.3g} at t = {t:.4g} s"

    def _duration(self, answer: Answer) -> float:
        ocp = self.transcription.ocp
        return float(answer.w[-1]) if ocp.has_free_time else ocp.duration

    def _times(self, answer: Answer, data: Data) -> np.ndarray:
        return data.t0 + self.transcription.fractions * self._duration(answer)

    def _solution(
        self, data: Data, answers: list[Answer], status: Status, message: str, seconds: float
    ) -> Solution:
        """The last answer, with the work of all."""
        tr, answer = self.transcription, answers[-1]
        z, u = tr.split(answer.w)
        residuals = answer.history("inf_du")
        return Solution(
            problem=tr.ocp,
            solver=repr(self.solver),
            status=status,
            message=message,
            t=self._times(answer, data),
            x=z[:, : tr.ocp.model.nx],
            x0=data.x0,
            costate=tr.costates(answer.w, answer.lam_x, answer.lam_g, data),
            u=u,
            cost=answer.cost,
            residual=float(residuals[-1]) if residuals.size else 0.0,
            iterations=sum(a.count for a in answers),
            work=sum((a.work for a in answers), Work()),
            history={
                "cost": answer.history("obj"),
                "infeasibility": answer.history("inf_pr"),
                "residual": residuals,
            },
            parameters=data.values.as_dict(),
            solve_time=seconds,
        )


# An optimiser that cannot meet a constraint may also exploit the integrator's error to do so.
_MAYBE_INFEASIBLE = (
    Status.ITERATION_LIMIT,
    Status.FAILED,
    Status.INACCURATE,
)
