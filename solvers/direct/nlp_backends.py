"""The nonlinear programming backends: their options, and set up for one problem.

``NlpBackend``: the options; ``Nlp``: a backend set up for one problem; ``CasadiNlp``: IPOPT or
fatrop; ``NativeNlp``: the native solver, see ``solvers/direct/native``.
"""

import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, Protocol

import casadi as ca
import numpy as np

from ocp import UnsupportedProblem
from ocp.internal import (
    QUIET,
    BufferedNlp,
    Transcription,
    Unbuildable,
    announce_interpreted,
    check_choice,
    check_flag,
    check_positive,
    check_whole,
    refuse_in_subprocess,
)
from solvers.direct.fatrop_options import fatrop_options
from solvers.direct.fitted_multipliers import with_fitted_multipliers
from solvers.direct.native.native_library import NativeLibrary, NativeReport
from solvers.direct.native.native_solve import NativeLimits, NativeSolve
from solvers.direct.native.stage_code import StageCode
from solvers.direct.nlp_result import HUGE, Bounds, NlpResult
from solvers.direct.optimality_residual import OptimalityCheck, OptimalityResidual
from solvers.direct.subprocess_function import (
    SUBPROCESS_SUPPORTED,
    SubprocessFunction,
    SubprocessLost,
)
from solvers.direct.transcribed_problem import TranscribedProblem
from solvers.direct.warm_start import WarmStart


@dataclass(frozen=True)
class NlpBackend:
    """A backend with its options, to be checked by ``check``.

    Args:
        name: ``"ipopt"``; ``"fatrop"``, which exploits the stages; or ``"native"``, which does so
            in C of its own.
        tolerance: of the optimality conditions.
        max_iterations: limit.
        verbose: let it print.
        time_limit: for one run [s]. IPOPT reads the clock in each iteration and returns its
            iterate. fatrop has no time limit, and may try for ever to solve a singular linear
            system inside one iteration. With a limit it runs in a process of its own, see
            ``SubprocessFunction``; a process that is ended returns no iterate.
        dependent_rows: let IPOPT regularise its linear system in every iteration, for constraints
            whose gradients depend on each other.
    """

    name: Literal["ipopt", "fatrop", "native"] = "ipopt"
    tolerance: float = 1e-9
    max_iterations: int = 300
    verbose: bool = False
    time_limit: float = np.inf
    dependent_rows: bool = False

    def check(self) -> None:
        """Check the options.

        Raises:
            ProblemError: for an unknown backend or a number that is not positive.
        """
        check_choice(self.name, ("ipopt", "fatrop", "native"), "backend")
        check_flag(self.verbose, "a backend's verbose")
        check_whole(self.max_iterations, "a backend's max_iterations")
        check_positive(self.tolerance, "a backend's tolerance")
        check_positive(self.time_limit, "a backend's time_limit [s]", finite=False)

    def build(self, transcription: TranscribedProblem) -> "Nlp":
        """Set the backend up for a transcribed problem.

        Raises:
            UnsupportedProblem: for what the backend cannot treat.
        """
        if self.name == "native":
            return self._native(transcription)
        if self.name == "fatrop" and self.time_limit < np.inf:
            refuse_in_subprocess(transcription.ocp)
        own = (
            self._ipopt() if self.name == "ipopt" else fatrop_options(transcription, self.tolerance)
        )
        common = QUIET | {
            "print_time": self.verbose,
            f"{self.name}.print_level": 5 if self.verbose else 0,
            f"{self.name}.max_iter": self.max_iterations,
        }
        function = ca.nlpsol("nlp", self.name, transcription.program, {**common, **own})
        return CasadiNlp(self, function, transcription.is_control, self._subprocess(function))

    def _native(self, transcription: TranscribedProblem) -> "Nlp":
        """Set the native solver up; IPOPT where it cannot be compiled, with a warning."""
        if not isinstance(transcription, Transcription):
            raise UnsupportedProblem(
                "the native backend takes the stages of multiple shooting alone"
            )
        if transcription.blocks is not None:
            raise UnsupportedProblem(
                f"{transcription.ocp.name}: the native backend takes no blocks; "
                "take backend='ipopt' or 'fatrop'"
            )
        if transcription.start_as_data:
            raise UnsupportedProblem(
                f"{transcription.ocp.name}: the native backend takes no start that is data; "
                "take backend='ipopt'"
            )
        options = NativeLimits(self.tolerance, self.max_iterations, self.time_limit)
        try:
            library = NativeLibrary.of(StageCode(transcription))
        except Unbuildable as reason:
            announce_interpreted(str(reason))
            return replace(self, name="ipopt").build(transcription)
        return NativeNlp(self, transcription, NativeSolve(library, options))

    def _subprocess(self, function: ca.Function) -> SubprocessFunction | None:
        """Return the process for fatrop with a time limit; None: run in this process."""
        if self.name != "fatrop" or self.time_limit == np.inf:
            return None
        if not SUBPROCESS_SUPPORTED:
            warnings.warn(
                "a time limit of fatrop needs fork and alarms, which this system lacks: "
                "it runs without one",
                stacklevel=2,
            )
            return None
        return SubprocessFunction(function, self.time_limit, verbose=self.verbose)

    def _ipopt(self) -> dict[str, Any]:
        clock = {"ipopt.max_wall_time": self.time_limit} if self.time_limit < np.inf else {}
        # IPOPT otherwise returns controls outside their bounds, by up to 1e-8 relative.
        relax = {"ipopt.bound_relax_factor": 0.0}
        rows = {"ipopt.perturb_always_cd": "yes"} if self.dependent_rows else {}
        return {"ipopt.sb": "yes", "ipopt.tol": self.tolerance, **relax, **clock, **rows}


class Nlp(Protocol):
    """A backend set up for one problem."""

    @property
    def backend(self) -> NlpBackend:
        """The options."""
        ...

    @property
    def function(self) -> ca.Function:
        """A ``casadi.nlpsol`` of the program, whose derivatives are used."""
        ...

    def solve(
        self,
        w0: np.ndarray,
        p: np.ndarray,
        bounds: Bounds,
        warm: WarmStart | None = None,
    ) -> NlpResult:
        """Run the backend; return the first iterate where its result is not finite.

        Args:
            w0: first iterate.
            p: data of the problem.
            bounds: lbx, ubx, lbg, ubg.
            warm: what is known of the first iterate beside.
        """
        ...

    def optimality(self, result: NlpResult, p: np.ndarray, bounds: Bounds) -> OptimalityResidual:
        """Return how well a result meets the first-order conditions, without any scaling."""
        ...

    def judged(self, result: NlpResult, p: np.ndarray, bounds: Bounds) -> NlpResult:
        """Return a result that meets the constraints with a residual, whatever the backend says.

        Args:
            result: of one run; its residual stays None where it is that of no iterate.
            p: data of the problem.
            bounds: lbx, ubx, lbg, ubg.
        """
        ...


@dataclass(frozen=True, eq=False)
class CasadiNlp:
    """IPOPT or fatrop, set up for one problem.

    Attributes:
        backend: the options.
        function: the ``casadi.nlpsol``.
        is_control: which unknowns are controls, bool (size,).
        subprocess: the process that it runs in; None: this one.
    """

    backend: NlpBackend
    function: ca.Function
    is_control: np.ndarray
    subprocess: SubprocessFunction | None = None

    def solve(
        self,
        w0: np.ndarray,
        p: np.ndarray,
        bounds: Bounds,
        warm: WarmStart | None = None,
    ) -> NlpResult:
        """Run the backend, see ``Nlp``; it starts cold."""
        inputs = {"x0": w0, "p": p, **bounds}
        try:
            raw, stats = self.subprocess(inputs) if self.subprocess else self._here(inputs)
        except RuntimeError:  # fatrop throws where functions are not finite
            stats = {"return_status": "it threw an exception", "success": False}
            return NlpResult.without_iterate(w0, len(bounds["lbg"]), stats)
        except SubprocessLost as loss:
            stats = {"return_status": str(loss), "success": False}
            return NlpResult.without_iterate(w0, len(bounds["lbg"]), stats, is_lost=True)
        if not all((np.abs(raw[name]) < HUGE).all() for name in ("x", "f", "g", "lam_x", "lam_g")):
            return NlpResult.without_iterate(w0, len(bounds["lbg"]), stats)
        # An interior point may violate a bound by rounding; the result does not.
        w = np.clip(raw["x"], bounds["lbx"], bounds["ubx"])
        return NlpResult(w, float(raw["f"][0]), raw["g"], raw["lam_x"], raw["lam_g"], stats)

    @cached_property
    def _here(self) -> BufferedNlp:
        """What runs it in this process."""
        return BufferedNlp(self.function)

    def optimality(self, result: NlpResult, p: np.ndarray, bounds: Bounds) -> OptimalityResidual:
        """Return how well a result meets the first-order conditions, see ``Nlp``."""
        return self._check(result, p, bounds)

    def judged(self, result: NlpResult, p: np.ndarray, bounds: Bounds) -> NlpResult:
        """Return it with fitted multipliers, see ``Nlp``."""
        if not self._check.is_value(result, p):
            return result
        return with_fitted_multipliers(self.function, result, p, bounds, self.is_control)

    @cached_property
    def _check(self) -> OptimalityCheck:
        return OptimalityCheck(self.function)


@dataclass(frozen=True, eq=False)
class NativeNlp:
    """The native solver, set up for one problem.

    Attributes:
        backend: the options.
        transcription: the problem on its grid.
        run: solves, between vectors of unknowns and rows.
    """

    backend: NlpBackend
    transcription: Transcription
    run: NativeSolve

    @property
    def function(self) -> ca.Function:
        """That of IPOPT, for those who ask for derivatives of the whole program."""
        return self.ipopt.function

    @cached_property
    def ipopt(self) -> Nlp:
        """IPOPT for the same program, built where it is asked for: never in a control loop."""
        return replace(self.backend, name="ipopt").build(self.transcription)

    def solve(
        self,
        w0: np.ndarray,
        p: np.ndarray,
        bounds: Bounds,
        warm: WarmStart | None = None,
    ) -> NlpResult:
        """Run the solver, see ``Nlp``."""
        return self.run(w0, p, bounds, warm)

    def optimality(self, result: NlpResult, p: np.ndarray, bounds: Bounds) -> OptimalityResidual:
        """Return its own residual: it is not scaled."""
        report: NativeReport = result.stats["report"]
        return OptimalityResidual(report.dual, report.multiplier)

    def judged(self, result: NlpResult, p: np.ndarray, bounds: Bounds) -> NlpResult:
        """Return it with its own residual, which is not scaled, see ``Nlp``."""
        report: NativeReport = result.stats["report"]
        return replace(result, residual=max(report.dual, report.product))
