"""``NativeSolve``: the native solver between vectors of unknowns and rows of the program."""

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np

from ocp.internal import RunData
from solvers.direct.native.flat_rows import FlatRows
from solvers.direct.native.native_library import NOTE, NativeLibrary, NativeOptions, NativeReport
from solvers.direct.nlp_result import NlpResult
from solvers.direct.warm_start import WarmStart

# First barrier parameter, and that of a start with costates.
COLD, WARM = 0.1, 1e-4
# Those of a program frozen at an answer, from the multipliers of that, one after the other where no
# step is found: further from it bounds may be active that were not.
_FROZEN = (1e-6, 1e-3, 1e-1)
# How long a solve may take before Python looks for signals [s].
_PAUSE = 0.1
# What ``Ending`` of ``workspace.h`` means, in words that ``return_words`` explains.
ENDINGS = (
    "solved",
    "iteration limit",
    "no step",
    "not finite",
    "time limit",
    "diverged",
)
# Work of a run in its statistics, which that of the next one is added to.
_WORK = ("iter_count", "n_call_nlp_g", "n_call_nlp_jac_g", "factorisations")
# After these no other way to iterate is tried from the same first iterate.
_FINAL = ("solved", "iteration limit", "time limit")


class _Way(Enum):
    """How to iterate from a first iterate."""

    WARM = "from the costates of a guess"
    COLD = "from multipliers that are fitted"
    MONOTONE = "with a barrier parameter that only falls"


@dataclass(frozen=True, eq=False)
class NativeLimits:
    """The options of a backend that the native solver knows.

    Attributes:
        tolerance: of the optimality conditions.
        max_iterations: limit.
        time_limit: for one run [s].
    """

    tolerance: float
    max_iterations: int
    time_limit: float

    def options(self, way: "_Way", iterations: int, seconds: float) -> NativeOptions:
        """Return them as the library takes them, after what other ways have used up."""
        warm, monotone = way is _Way.WARM, way is _Way.MONOTONE
        return NativeOptions(
            tolerance=self.tolerance,
            barrier=WARM if warm else COLD,
            max_iterations=float(self.max_iterations - iterations),
            time_limit=self.time_limit - seconds,
            pause=_PAUSE,
            warm=float(warm),
            monotone=float(monotone),
            frozen=0.0,
        )

    @property
    def of_frozen(self) -> tuple[NativeOptions, ...]:
        """Those of a frozen program, see ``frozen.h``, to be tried in this order."""
        options = [self.options(_Way.WARM, 0, 0.0) for _ in _FROZEN]
        for each, barrier in zip(options, _FROZEN, strict=True):
            each.barrier, each.frozen = barrier, 1.0
        return tuple(options)


@dataclass(frozen=True, eq=False)
class NativeSolve:
    """The native solver for one transcribed problem, between vectors of unknowns and rows.

    Attributes:
        library: compiled, with its memory.
        limits: of every run.
    """

    library: NativeLibrary
    limits: NativeLimits

    def __call__(
        self,
        w0: np.ndarray,
        p: np.ndarray,
        bounds: dict[str, np.ndarray],
        warm: WarmStart | None,
    ) -> NlpResult:
        """Run it, in ways that follow each other; return the best of their results.

        The first iterate comes back where that is not finite.

        Args:
            w0: first iterate.
            p: data of the problem, see ``Transcription.data_vector``.
            bounds: lbx, ubx, lbg, ubg.
            warm: what is known of the first iterate; None: it is a cold start.
        """
        library, at = self.library, self.library.arrays
        at.data[:] = library.code.data(p)
        self.put_bounds(bounds)
        has_sides = bool(at.has_low.any() or at.has_up.any())
        skipped = {_Way.WARM: warm is None, _Way.MONOTONE: not has_sides}
        stats: dict[str, Any] = {}
        best: NlpResult | None = None
        started = perf_counter() - (warm.seconds if warm else 0.0)
        for way in _Way:
            if skipped.get(way) or (best and self._is_used_up(stats, perf_counter() - started)):
                continue
            used = stats.get("iter_count", 0), perf_counter() - started
            ending = ENDINGS[self._ended(way, w0, warm, self.limits.options(way, *used))]
            stats = _stats(ending, library.report(), library.notes(), stats)
            found = self._result(bounds, stats)
            if best is None or _remainder(found) < _remainder(best):
                best = found
            if ending in _FINAL:
                break
        assert best is not None  # a cold start is never skipped as the first
        stats = best.stats | {name: stats[name] for name in _WORK}
        if not best.is_finite:
            return NlpResult.without_iterate(w0, len(bounds["lbg"]), stats)
        return replace(best, stats=stats)

    def _ended(
        self, way: _Way, w0: np.ndarray, warm: WarmStart | None, options: NativeOptions
    ) -> int:
        """Iterate in one way from the first iterate; return how it has ended."""
        at = self.library.arrays
        if way is _Way.WARM and warm and warm.ending is not None:
            return warm.ending
        at.x[:], at.u[:] = self.library.code.transcription.split(w0)
        at.costate[:] = 0.0
        if way is _Way.WARM and warm and warm.costate is not None:
            at.costate[:, : warm.costate.shape[1]] = warm.costate
        return self.library.solve(options)

    def put_data(self, data: RunData) -> None:
        """Write times and parameters of a run."""
        code, at = self.library.code, self.library.arrays
        if code.has_parameters:
            at.data[:] = code.data(code.transcription.data_vector(data))
        else:
            at.data[:, 0], at.data[:, 1:] = data.t0, code.grid

    def put_bounds(self, bounds: dict[str, np.ndarray]) -> None:
        """Write bounds of all unknowns and rows: lbx, ubx, lbg, ubg."""
        self._rows.put_bounds(self.library.arrays, bounds)
        self.library.read_bounds()

    @cached_property
    def warm_options(self) -> NativeOptions:
        """Those of a run from costates, by itself."""
        return self.limits.options(_Way.WARM, 0, 0.0)

    @cached_property
    def cold_options(self) -> NativeOptions:
        """Those of a run without costates."""
        return self.limits.options(_Way.COLD, 0, 0.0)

    def _is_used_up(self, stats: dict[str, Any], seconds: float) -> bool:
        """Whether neither time nor iterations are left for another way."""
        is_late = seconds >= self.limits.time_limit
        return is_late or stats["iter_count"] >= self.limits.max_iterations

    def _result(self, bounds: dict[str, np.ndarray], stats: dict[str, Any]) -> NlpResult:
        at, rows, tr = self.library.arrays, self._rows, self.library.code.transcription
        gradient = self.library.lagrangian_gradient()
        w = np.clip(tr.join(at.x, at.u), bounds["lbx"], bounds["ubx"])
        lam_x, g, lam_g = rows.multipliers_of_bounds(at, gradient), rows.values(at), rows.lam_g(at)
        return NlpResult(w, stats["report"].cost, g, lam_x, lam_g, stats)

    @cached_property
    def _rows(self) -> FlatRows:
        return FlatRows.of(self.library.code)


def _remainder(result: NlpResult) -> float:
    """Return what a result leaves of the optimality conditions; inf where it is not finite."""
    report: NativeReport = result.stats["report"]
    left = np.max([report.primal, report.dual, report.product])
    if not (result.is_finite and np.isfinite(left)):
        return np.inf
    return 0.0 if result.success else float(left)


def _stats(
    word: str, report: NativeReport, notes: np.ndarray, before: dict[str, Any]
) -> dict[str, Any]:
    """Return the statistics of a run as ``NlpResult`` reads them, with the work of those before."""
    work = {
        "iter_count": int(report.iterations),
        "n_call_nlp_g": int(report.values + report.evaluations),
        "n_call_nlp_jac_g": int(report.evaluations),
        "factorisations": int(report.factorisations),
    }
    by_name = dict(zip(NOTE, notes.T.copy(), strict=True))
    named = {"obj": by_name["cost"], "inf_pr": by_name["primal"], "inf_du": by_name["dual"]}
    return {
        "return_status": word,
        "success": word == ENDINGS[0],
        **{name: count + before.get(name, 0) for name, count in work.items()},
        "iterations": by_name | named,
        "report": report,
    }
