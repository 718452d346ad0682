"""Direct multiple shooting: the problem on a grid, solved by an interior-point method."""

from collections.abc import Mapping
from contextlib import nullcontext, redirect_stderr
from dataclasses import dataclass, field, replace
from functools import cached_property
from io import StringIO
from time import perf_counter
from typing import Any, Literal

import casadi as ca
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
        if self.max_iterations < 1 or not (self.tolerance > 0.0 and self.accuracy > 0.0):
            raise ProblemError(
                "multiple shooting needs at least one iteration, positive tolerance and accuracy"
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
        if self.backend == "fatrop":
            _refuse_too_many_equations(transcription)
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


def _refuse_too_many_equations(transcription: Transcription) -> None:
    """Refuse what fatrop would meet with an assertion of its own, printed by itself."""
    ocp, n = transcription.ocp, transcription.n
    for node, unknowns in ((0, transcription.nz + ocp.model.nu), (n, transcription.nz)):
        rows = [r for r in transcription.rows if r.node == node and r.is_equation]
        rows = [r for r in rows if r.place in ("path", "initial", "terminal")]
        if len(rows) > unknowns:
            raise UnsupportedProblem(
                f"{ocp.name}: {len(rows)} equations for {unknowns} unknowns at node {node} "
                f"(the last is '{rows[-1].name}'); fatrop takes no more equations than unknowns"
            )


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

    @property
    def count(self) -> int:
        return int(self.stats.get("iter_count", 0))


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
        if status is Status.SOLVED and not self._moved(w0, answer):
            # A backend looks at curvature only where it goes: one that stays on its first
            # controls takes a maximum or a saddle there for a solution. From a minimum the
            # second run comes back at once.
            answer = self._ask(self._kicked(answer, bounds), p, bounds)
            status, message = self._verdict(answer, data, bounds)
        if status in _MAYBE_INFEASIBLE and (ocp.constraints or ocp.state_bounds.is_active):
            found = self._feasibility.least_violating(w0, bounds, p)
            if found and found[1] > _UNAVOIDABLE:
                elastic = replace(answer, w=found[0])
                status, message = Status.INFEASIBLE, self._where(elastic, data, *found[1:])
            elif found:
                answer = self._ask(found[0], p, bounds)
                status, message = self._verdict(answer, data, bounds)
        return self._solution(data, answer, status, message, perf_counter() - started)

    @cached_property
    def _feasibility(self) -> Feasibility:
        return Feasibility(self.transcription)

    def _ask(self, w0: np.ndarray, p: np.ndarray, bounds: dict[str, np.ndarray]) -> _Answer:
        """Run the backend; if it returns a number that is not finite, return the first iterate."""
        nothing = np.zeros(len(self.transcription.rows))
        try:
            # CasADi warns of multipliers that are not finite, whatever its options say.
            with nullcontext() if self.solver.verbose else redirect_stderr(StringIO()):
                raw = {k: np.array(v).ravel() for k, v in self.nlp(x0=w0, p=p, **bounds).items()}
        except RuntimeError:  # fatrop throws where functions are not finite
            stats = {"return_status": "it threw an exception", "success": False}
            return _Answer(w0, np.inf, nothing, np.zeros_like(w0), nothing, stats)
        stats = self.nlp.stats()
        if not all(np.isfinite(raw[name]).all() for name in ("x", "f", "g", "lam_x", "lam_g")):
            return _Answer(w0, np.inf, nothing, np.zeros_like(w0), nothing, stats)
        # The interior point may sit outside a bound by rounding; what is returned does not.
        w = np.clip(raw["x"], bounds["lbx"], bounds["ubx"])
        return _Answer(w, float(raw["f"][0]), raw["g"], raw["lam_x"], raw["lam_g"], stats)

    def _moved(self, w0: np.ndarray, answer: _Answer) -> bool:
        """Whether any control differs from the first iterate's."""
        before, after = self.transcription.split(w0)[1], self.transcription.split(answer.w)[1]
        return bool(np.any(np.abs(after - before) > _SAME * (1.0 + np.abs(before))))

    def _kicked(self, answer: _Answer, bounds: dict[str, np.ndarray]) -> np.ndarray:
        """Return the unknowns with slightly different controls; the same for the same answer."""
        z, u = self.transcription.split(answer.w)
        u = u + _KICK * np.random.default_rng(0).normal(size=u.shape) * (1.0 + np.abs(u))
        return np.clip(self.transcription.join(z, u), bounds["lbx"], bounds["ubx"])

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
            excess, row = self._start_violation(answer)
            if excess > _VIOLATED:
                return Status.INFEASIBLE, self._where(answer, data, excess, row)
            error, node = self._integration_error(answer, data)
            if error <= self.solver.accuracy:
                return Status.SOLVED, ""
            t = self._times(answer, data)[node]
            return Status.INACCURATE, f"a state moves by {error:.2g} at t = {t:.4g} s"
        if answer.word in _INFEASIBLE or answer.stats.get("success"):
            return Status.INFEASIBLE, where
        if answer.count >= self.solver.max_iterations:
            return Status.ITERATION_LIMIT, where
        if answer.word == "Diverging_Iterates":
            return Status.DIVERGED, where or "the cost may be unbounded below"
        return Status.FAILED, f"{self.solver.backend} says {answer.word}. {where}".strip()

    def _start_violation(self, answer: _Answer) -> tuple[float, Row | None]:
        """By how much the given start itself violates a path constraint, which is not imposed."""
        rows, path = self.transcription.rows, self.transcription.ocp.at("path")
        here = [i for i, row in enumerate(rows) if row.place == "path" and row.node == 0]
        if not here:
            return 0.0, None
        box = Box(*(np.concatenate([getattr(c, s) for c in path]) for s in ("lower", "upper")))
        excess = box.excess(answer.g[here])
        worst = int(excess.argmax())
        return float(excess[worst]), rows[here[worst]]

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
            iterations=answer.count,
            work=Work(
                rollouts=int(stats.get("n_call_nlp_g", 0)),
                jacobians=int(stats.get("n_call_nlp_jac_g", 0)),
                factorisations=answer.count,
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
