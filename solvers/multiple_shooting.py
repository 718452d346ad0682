"""Direct multiple shooting: the problem on a grid, solved by an interior-point method."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp import (
    OCP,
    RK4,
    Data,
    Integrator,
    ProblemError,
    Program,
    Row,
    Solution,
    Solver,
    Stage,
    Start,
    Status,
    Transcription,
    UnsupportedProblem,
    Work,
)
from solvers.feasibility import Feasibility

# Beyond this a constraint counts as violated, whatever the backend says about scaled ones.
_VIOLATED = 1e-6
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
    """

    intervals: int = 75
    integrator: Integrator = field(default_factory=RK4)
    backend: Literal["ipopt", "fatrop"] = "ipopt"
    tolerance: float = 1e-9
    max_iterations: int = 300
    accuracy: float = 1e-2
    verbose: bool = False

    def __post_init__(self) -> None:
        """Check the options."""
        if self.intervals < 1:
            raise ProblemError(
                f"multiple shooting needs at least one interval, not {self.intervals}"
            )
        if self.backend not in _OPTIONS:
            raise ProblemError(f"backend {self.backend!r} is not one of {', '.join(_OPTIONS)}")

    def build(self, ocp: OCP) -> "MultipleShootingProgram":
        """Transcribe the problem and set the backend up."""
        if self.backend == "fatrop" and any(not c.is_equation for c in ocp.at("initial")):
            raise UnsupportedProblem(
                f"{ocp.name}: fatrop takes no inequality at the start; use ipopt"
            )
        transcription = Transcription(ocp, self.intervals, self.integrator)
        options = _OPTIONS[self.backend](self, transcription)
        nlp = ca.nlpsol("nlp", self.backend, transcription.program, options)
        n, finer = transcription.n, replace(self.integrator, steps=2 * self.integrator.steps)
        rollout = Stage.of(ocp, self.integrator, held=True).step.mapaccum(n)
        check = Stage.of(ocp, finer, held=True).step.map(n)
        return MultipleShootingProgram(self, transcription, nlp, rollout, check)


def _ipopt(solver: MultipleShooting, transcription: Transcription) -> dict[str, Any]:
    return {
        **_COMMON,
        "print_time": solver.verbose,
        "ipopt.print_level": 5 if solver.verbose else 0,
        "ipopt.sb": "yes",
        "ipopt.tol": solver.tolerance,
        "ipopt.max_iter": solver.max_iterations,
        # IPOPT otherwise returns controls outside their bounds, by up to 1e-8 relative.
        "ipopt.bound_relax_factor": 0.0,
    }


def _fatrop(solver: MultipleShooting, transcription: Transcription) -> dict[str, Any]:
    return {
        **_COMMON,
        "print_time": solver.verbose,
        "structure_detection": "auto",
        "equality": [row.is_equation for row in transcription.rows],
        "fatrop.print_level": 5 if solver.verbose else 0,
        "fatrop.tolerance": solver.tolerance,
        "fatrop.max_iter": solver.max_iterations,
    }


_COMMON = {"error_on_fail": False, "show_eval_warnings": False}
_OPTIONS = {"ipopt": _ipopt, "fatrop": _fatrop}


@dataclass(frozen=True, eq=False)
class _Answer:
    """What the backend returned, with every number finite."""

    w: np.ndarray
    cost: float
    g: np.ndarray
    lam_x: np.ndarray
    lam_g: np.ndarray
    stats: dict[str, Any]

    @property
    def word(self) -> str:
        return str(self.stats.get("return_status", ""))


@dataclass(frozen=True, eq=False)
class MultipleShootingProgram(Program):
    """A transcribed problem with its backend.

    Attributes:
        solver: the options.
        transcription: the problem on its grid.
        nlp: the backend.
        rollout: all intervals in a row, for first guesses.
        check: every interval on its own, with half the step.
    """

    solver: MultipleShooting
    transcription: Transcription
    nlp: ca.Function
    rollout: ca.Function
    check: ca.Function

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
        data = Data(ocp.start(x0), t0, ocp.parameter_values(parameters))
        bounds, p = tr.bounds(data), tr.data_vector(data)
        z, u = self._first_iterate(data, guess or ocp.guess)
        w0 = np.clip(tr.join(z, u), bounds["lbx"], bounds["ubx"])
        answer = self._ask(w0, p, bounds)
        status, message = self._verdict(answer, data, bounds)
        if status in _MAYBE_INFEASIBLE and (ocp.constraints or ocp.state_bounds.is_active):
            found = self._feasibility.least_violating(w0, bounds, p)
            if found and found[1] > _UNAVOIDABLE:
                status, message = Status.INFEASIBLE, self._where(answer, data, *found[1:])
            elif found:
                answer = self._ask(found[0], p, bounds)
                status, message = self._verdict(answer, data, bounds)
        return self._solution(data, answer, status, message, perf_counter() - started)

    @cached_property
    def _feasibility(self) -> Feasibility:
        return Feasibility(self.transcription)

    def _ask(self, w0: np.ndarray, p: np.ndarray, bounds: dict[str, np.ndarray]) -> _Answer:
        """Run the backend; if it returns a number that is not finite, return the first iterate."""
        raw = {k: np.array(v).ravel() for k, v in self.nlp(x0=w0, p=p, **bounds).items()}
        stats = self.nlp.stats()
        if not all(np.isfinite(raw[name]).all() for name in ("x", "f", "g", "lam_x", "lam_g")):
            nothing = np.zeros(len(self.transcription.rows))
            return _Answer(w0, np.inf, nothing, np.zeros_like(w0), nothing, stats)
        # The interior point may sit outside a bound by rounding; what is returned does not.
        w = np.clip(raw["x"], bounds["lbx"], bounds["ubx"])
        return _Answer(w, float(raw["f"][0]), raw["g"], raw["lam_x"], raw["lam_g"], stats)

    # -- the first iterate -------------------------------------------------------------------

    def _first_iterate(self, data: Data, guess: Start | None) -> tuple[np.ndarray, np.ndarray]:
        """States and controls of the guess; without states, the controls' own roll-out."""
        tr = self.transcription
        ocp, m, nodes = tr.ocp, tr.ocp.model, tr.fractions
        x = guess.sample("x", nodes, m.nx) if guess else None
        u = guess.sample("u", nodes[:-1], m.nu) if guess else None
        duration = (guess.duration if guess and ocp.has_free_time else None) or ocp.duration
        u = ocp.control_bounds.clip(np.zeros((tr.n, m.nu)) if u is None else u)
        if x is None:
            x, _ = self.rollout(data.x0, u.T, *self._schedule(data, duration))
            x = np.vstack([data.x0, np.array(x).T])
        if not np.isfinite(x).all():
            x = np.tile(data.x0, (tr.n + 1, 1))
        z = np.hstack([x, np.full((tr.n + 1, 1), duration)]) if ocp.has_free_time else x
        return z, u

    def _schedule(self, data: Data, duration: float) -> list[np.ndarray]:
        """Times, steps and parameters of every interval."""
        nodes, n = self.transcription.fractions, self.transcription.n
        left, right = data.values.on(nodes)
        t = data.t0 + nodes[None, :-1] * duration
        return [t, np.full((1, n), duration / n), left.T, right.T]

    # -- the verdict -------------------------------------------------------------------------

    def _verdict(
        self, answer: _Answer, data: Data, bounds: dict[str, np.ndarray]
    ) -> tuple[Status, str]:
        """Status from the backend's word, the constraints themselves and the integrator."""
        if not np.isfinite(answer.cost):
            return Status.DIVERGED, f"the backend met a number that is not finite ({answer.word})"
        violation, row = self.transcription.worst(answer.w, answer.g, bounds)
        violated = violation > _VIOLATED
        where = self._where(answer, data, violation, row) if violated else ""
        if answer.stats.get("success") and not violated:
            error, node = self._integration_error(answer, data)
            if error <= self.solver.accuracy:
                return Status.SOLVED, ""
            t = self._times(answer, data)[node]
            return Status.INACCURATE, f"a state moves by {error:.2g} at t = {t:.4g} s"
        if answer.word in _INFEASIBLE or answer.stats.get("success"):
            return Status.INFEASIBLE, where
        if answer.word == "Maximum_Iterations_Exceeded":
            return Status.ITERATION_LIMIT, where
        if answer.word == "Diverging_Iterates":
            return Status.DIVERGED, where or "the cost may be unbounded below"
        return Status.FAILED, f"{self.solver.backend} says {answer.word}. {where}".strip()

    def _integration_error(self, answer: _Answer, data: Data) -> tuple[float, int]:
        """By how much half the step moves the end of an interval, relative to 1 + abs(x)."""
        tr = self.transcription
        if tr.ocp.model.is_discrete:
            return 0.0, 0
        z, u = tr.split(answer.w)
        x = z[:, : tr.ocp.model.nx]
        after, _ = self.check(x[:-1].T, u.T, *self._schedule(data, self._duration(answer)))
        moved = np.abs(np.array(after).T - x[1:]) / (1.0 + np.abs(x[1:]))
        worst = int(moved.max(axis=1).argmax())
        return float(moved[worst].max()), worst + 1

    def _where(self, answer: _Answer, data: Data, violation: float, row: Row | None) -> str:
        if row is None:
            return ""
        t = self._times(answer, data)[row.node]
        return f"'{row.name}' is violated by {violation:.3g} at t = {t:.4g} s"

    def _duration(self, answer: _Answer) -> float:
        ocp = self.transcription.ocp
        return float(answer.w[-1]) if ocp.has_free_time else ocp.duration

    def _times(self, answer: _Answer, data: Data) -> np.ndarray:
        return data.t0 + self.transcription.fractions * self._duration(answer)

    def _solution(
        self, data: Data, answer: _Answer, status: Status, message: str, seconds: float
    ) -> Solution:
        tr, stats = self.transcription, answer.stats
        z, u = tr.split(answer.w)
        iterations = stats.get("iterations") or {}
        count = int(stats.get("iter_count", 0))
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
            residual=float(iterations["inf_du"][-1]) if iterations else 0.0,
            iterations=count,
            work=Work(
                rollouts=int(stats.get("n_call_nlp_g", 0)),
                jacobians=int(stats.get("n_call_nlp_jac_g", 0)),
                factorisations=count,
            ),
            history={
                "cost": np.array(iterations.get("obj", [])),
                "infeasibility": np.array(iterations.get("inf_pr", [])),
                "residual": np.array(iterations.get("inf_du", [])),
            },
            parameters=data.values.as_dict(),
            solve_time=seconds,
        )


_INFEASIBLE = ("Infeasible_Problem_Detected", "Restoration_Failed", "Not_Enough_Degrees_Of_Freedom")
# An optimiser that cannot meet a constraint may also exploit the integrator's error to do so.
_MAYBE_INFEASIBLE = (
    Status.INFEASIBLE,
    Status.ITERATION_LIMIT,
    Status.FAILED,
    Status.INACCURATE,
)
