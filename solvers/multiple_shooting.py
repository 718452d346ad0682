"""Direct multiple shooting: the problem on a grid, solved by an interior-point method."""

from collections.abc import Mapping
from dataclasses import dataclass, field
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
    ParameterValues,
    ProblemError,
    Program,
    Solution,
    Solver,
    Stage,
    Start,
    Status,
    Transcription,
    UnsupportedProblem,
    Work,
)

# Beyond this a constraint counts as violated, whatever the backend says about scaled ones.
_VIOLATED = 1e-6


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
        keep: where path constraints are present, the invariants of the problem are kept to
            this at the nodes (in their own units); ``inf``: not imposed. Without it a
            trajectory that cannot satisfy a hard constraint may do so by integration error.
        verbose: let the backend print.
    """

    intervals: int = 75
    integrator: Integrator = field(default_factory=RK4)
    backend: Literal["ipopt", "fatrop"] = "ipopt"
    tolerance: float = 1e-9
    max_iterations: int = 500
    keep: float = 1e-4
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
        keep = self.keep if ocp.at("path") else np.inf
        transcription = Transcription(ocp, self.intervals, self.integrator, keep)
        options = _OPTIONS[self.backend](self, transcription)
        nlp = ca.nlpsol("nlp", self.backend, transcription.program, options)
        stage = Stage.of(ocp, self.integrator, held=True).step.mapaccum(transcription.n)
        return MultipleShootingProgram(self, transcription, nlp, stage)


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
class MultipleShootingProgram(Program):
    """A transcribed problem with its backend."""

    solver: MultipleShooting
    transcription: Transcription
    nlp: ca.Function
    rollout: ca.Function

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: Start | None = None,
    ) -> Solution:
        """Solve for these data."""
        started = perf_counter()
        ocp = self.transcription.ocp
        data = Data(ocp.start(x0), t0, ocp.parameter_values(parameters))
        z, u = self._first_iterate(data, guess or ocp.guess)
        bounds = self.transcription.bounds(data)
        w0 = np.clip(self.transcription.join(z, u), bounds["lbx"], bounds["ubx"])
        answer = self.nlp(x0=w0, p=self.transcription.data_vector(data), **bounds)
        result = {name: np.array(value).ravel() for name, value in answer.items()}
        return self._solution(data, result, bounds, w0, perf_counter() - started)

    def _first_iterate(self, data: Data, guess: Start | None) -> tuple[np.ndarray, np.ndarray]:
        """States and controls of the guess; without states, the controls' own roll-out."""
        tr = self.transcription
        ocp, m, nodes = tr.ocp, tr.ocp.model, tr.fractions
        x = guess.sample("x", nodes, m.nx) if guess else None
        u = guess.sample("u", nodes[:-1], m.nu) if guess else None
        duration = (guess.duration if guess and ocp.has_free_time else None) or ocp.duration
        if u is None:
            u = np.zeros((tr.n, m.nu))
        u = ocp.control_bounds.clip(u)
        if x is None:
            x = self._roll(data, u, duration)
        z = np.hstack([x, np.full((tr.n + 1, 1), duration)]) if ocp.has_free_time else x
        return z, u

    def _roll(self, data: Data, u: np.ndarray, duration: float) -> np.ndarray:
        n = self.transcription.n
        nodes = self.transcription.fractions
        left, right = data.values.on(nodes)
        t = data.t0 + nodes[:-1] * duration
        h = np.full((1, n), duration / n)
        x, _ = self.rollout(data.x0, u.T, t[None, :], h, left.T, right.T)
        states = np.vstack([data.x0, np.array(x).T])
        return states if np.isfinite(states).all() else np.tile(data.x0, (n + 1, 1))

    def _solution(
        self,
        data: Data,
        result: dict[str, np.ndarray],
        bounds: dict,
        w0: np.ndarray,
        seconds: float,
    ) -> Solution:
        tr, stats = self.transcription, self.nlp.stats()
        finite = all(np.isfinite(result[name]).all() for name in ("x", "lam_x", "lam_g"))
        if not finite:
            result |= {"x": w0, "lam_x": np.zeros(tr.size), "lam_g": np.zeros(len(tr.rows))}
        # The interior point may sit outside a bound by rounding; what is returned does not.
        w = np.clip(result["x"], bounds["lbx"], bounds["ubx"])
        z, u = tr.split(w)
        duration = z[-1, -1] if tr.ocp.has_free_time else tr.ocp.duration
        status, message = self._verdict(result["g"], bounds, finite, stats, data.t0, duration)
        iterations = stats.get("iterations") or {}
        return Solution(
            problem=tr.ocp,
            solver=repr(self.solver),
            status=status,
            message=message,
            t=data.t0 + tr.fractions * duration,
            x=z[:, : tr.ocp.model.nx],
            x0=data.x0,
            costate=tr.costates(w, result["lam_x"], result["lam_g"], data),
            u=u,
            cost=float(result["f"][0]) if finite else np.inf,
            residual=float(iterations["inf_du"][-1]) if iterations else 0.0,
            iterations=int(stats.get("iter_count", 0)),
            work=Work(
                rollouts=int(stats.get("n_call_nlp_g", 0)),
                jacobians=int(stats.get("n_call_nlp_jac_g", 0)),
                factorisations=int(stats.get("iter_count", 0)),
            ),
            history={
                "cost": np.array(iterations.get("obj", [])),
                "infeasibility": np.array(iterations.get("inf_pr", [])),
                "residual": np.array(iterations.get("inf_du", [])),
            },
            parameters=data.values.as_dict(),
            solve_time=seconds,
        )

    def _verdict(
        self, g: np.ndarray, bounds: dict, finite: bool, stats: dict, t0: float, duration: float
    ) -> tuple[Status, str]:
        """Status from the backend's word *and* the constraints themselves."""
        word = str(stats.get("return_status", ""))
        if not finite:
            return Status.DIVERGED, f"the backend met a number that is not finite ({word})"
        violation, row = self.transcription.worst(g, bounds)
        where = ""
        if row is not None and violation > _VIOLATED:
            t = t0 + self.transcription.fractions[row.node] * duration
            where = f"'{row.name}' is violated by {violation:.3g} at t = {t:.4g} s"
        if stats.get("success") and not where:
            return Status.SOLVED, ""
        if word in _INFEASIBLE or (stats.get("success") and where):
            return Status.INFEASIBLE, where
        if word == "Maximum_Iterations_Exceeded":
            return Status.ITERATION_LIMIT, where
        if word == "Diverging_Iterates":
            return Status.DIVERGED, where or "the cost may be unbounded below"
        return Status.FAILED, f"{self.solver.backend} says {word}. {where}".strip()


_INFEASIBLE = ("Infeasible_Problem_Detected", "Restoration_Failed", "Not_Enough_Degrees_Of_Freedom")
