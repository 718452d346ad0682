"""How a direct method solves its nonlinear program: phases around a backend.

``NlpRun.solve`` names them: solve from the first iterate, and again from there where the answer is
one only after the backend's scaling; solve from perturbed controls where some did not move; restore
feasibility if it failed, and solve from there; solve from other first iterates. Each phase returns
an ``NlpOutcome``.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter

import numpy as np

from ocp import Status
from ocp.internal import RunData, start_violation
from solvers.direct.curvature_check import has_negative_curvature
from solvers.direct.feasibility_restoration import FeasibilityRestoration, LeastViolation
from solvers.direct.nlp_backends import NativeNlp, Nlp
from solvers.direct.nlp_outcome import NlpOutcome, OtherStart
from solvers.direct.nlp_result import NlpResult
from solvers.direct.nlp_verdict import NlpInputs, NlpVerdict
from solvers.direct.transcribed_problem import TranscribedProblem
from solvers.direct.unmoved_controls import at_bounds, perturbed, unmoved
from solvers.direct.warm_start import WarmStart

# What is said of an answer of IPOPT where the native solver was asked.
_HANDED_OVER = "by IPOPT, since the native solver found no step or no end"
# A least violation up to this counts as feasible: the elastic problem is solved to its tolerance.
_FEASIBLE = 1e-5
# Multipliers beyond this at a violation below that: the constraints' gradients depend on each
# other.
_UNBOUNDED, _CLOSE = 1e8, 1e-3
# A lower cost counts from this on, relative to 1 + abs(cost).
_LOWER = 1e-6
# Failures that an infeasible problem may cause. INACCURATE is one of them: to meet a constraint
# that cannot be met an optimiser may exploit the integrator's error.
_MAYBE_INFEASIBLE = (
    Status.ITERATION_LIMIT,
    Status.TIME_LIMIT,
    Status.FAILED,
    Status.INACCURATE,
)
# Failures that a first iterate may cause.
_MAYBE_FIRST_ITERATE = (
    Status.INFEASIBLE,
    Status.ITERATION_LIMIT,
    Status.DIVERGED,
    Status.FAILED,
)


@dataclass(frozen=True, eq=False)
class NlpRun:
    """The phases around a backend.

    Attributes:
        transcription: the problem on its grid.
        nlp: the backend, set up for it.
        accuracy: the largest accepted error of a state, relative to 1 + abs(x).
        state_error: (result, data) -> the largest such error, and the node where it occurs.
        feasibility_restoration: whether a failure is followed by a search for the least
            violating trajectory, and by other first iterates; and one of the native solver by
            IPOPT.
    """

    transcription: TranscribedProblem
    nlp: Nlp
    accuracy: float
    state_error: Callable[[NlpResult, RunData], tuple[float, int]]
    feasibility_restoration: bool = True

    def solve(
        self,
        w0: np.ndarray,
        data: RunData,
        others: Callable[[], Iterable[OtherStart]] = tuple,
        warm: WarmStart | None = None,
    ) -> NlpOutcome:
        """Solve for these data from a first iterate, which is clipped to the bounds.

        Args:
            w0: first iterate.
            data: of the run.
            others: returns first iterates to try before a failure is reported.
            warm: what is known of the first iterate beside.
        """
        started, inputs = perf_counter(), replace(self._inputs(w0, data), warm=warm)
        outcome = self._run_to_an_optimum(inputs)
        if self._may_be_infeasible(outcome):
            outcome = self.restore_feasibility(inputs, outcome)
        if self._may_start_elsewhere(outcome, data):
            outcome = self.solve_from_others(inputs, outcome, others(), started)
        return outcome

    # -- the phases ------------------------------------------------------------------------------

    def first_solve(self, inputs: NlpInputs, nlp: Nlp) -> tuple[NlpOutcome, Nlp]:
        """Run a backend from the first iterate, and again where only its scaling was met.

        Where the native solver fails, which has no restoration of its own, IPOPT runs, but not
        without ``feasibility_restoration``, as in a control loop: there is no time for it.

        Returns:
            How it has ended, and the backend that has answered.
        """
        outcome = self._run(nlp, inputs, inputs.w0)
        if self._hands_over(nlp) and self._is_handed_over(outcome):
            other, answering = self.first_solve(inputs, self._ipopt)
            return other.after(outcome), answering
        if outcome.status is Status.FAILED and outcome.last.success:
            outcome = self._run(nlp, inputs, outcome.last.w).after(outcome)
        return outcome, nlp

    def solve_from_perturbed(self, inputs: NlpInputs, first: NlpOutcome, nlp: Nlp) -> NlpOutcome:
        """Run the backend from a perturbation of its result.

        A backend tests curvature along its steps only: one that makes none accepts a maximum or
        a saddle as well. From a minimum the second run returns at once. fatrop may return to a
        saddle even so: then IPOPT decides, and so it does where the native solver fails.
        """
        every = np.ones(self.transcription.ocp.model.nu, dtype=bool)
        w = perturbed(self.transcription, inputs, first.last.w, every)
        second = self._run(nlp, inputs, w)
        if self._hands_over(nlp) and self._is_handed_over(second):
            return self.solve_from_perturbed(inputs, first.after(second), self._ipopt)
        is_unknown = second.status is Status.FAILED and not self._is_lower(inputs, second, first)
        if is_unknown and nlp.backend.name == "ipopt" and not nlp.backend.dependent_rows:
            return self.solve_from_perturbed(inputs, first, self._for_dependent_rows)
        if second.last.is_lost or is_unknown:
            message = f"from perturbed controls, {second.message}"
            return replace(first.after(second), status=Status.STATIONARY, message=message)
        is_checked = nlp.backend.name != "fatrop" or second.status is not Status.SOLVED
        if is_checked or not has_negative_curvature(nlp.function, second.last, inputs):
            return second.after(first)
        return self._run(self._ipopt, inputs, w).after(second.after(first))

    def solve_from_some_perturbed(
        self, inputs: NlpInputs, first: NlpOutcome, nlp: Nlp, which: np.ndarray
    ) -> NlpOutcome:
        """Run a backend from a result with some controls perturbed; keep the better answer.

        Where the derivative in a control vanishes by symmetry no step changes it, at a saddle as
        little as at a minimum.
        """
        w = perturbed(self.transcription, inputs, first.last.w, which)
        second = self._run(nlp, inputs, w)
        if self._hands_over(nlp) and self._is_handed_over(second):
            handed = first.after(second)
            return self.solve_from_some_perturbed(inputs, handed, self._ipopt, which)
        is_lower = self._is_lower(inputs, second, first)
        if second.status.is_success and is_lower:
            return second.after(first)
        kept = first.after(second)
        if not is_lower:
            return kept
        names = [n for n, on in zip(self.transcription.ocp.model.u_names, which, strict=True) if on]
        message = (
            f"no minimum: from perturbed {', '.join(names)} the cost falls to "
            f"{second.last.cost:.6g}, where {nlp.backend.name} ended with {second.status.name}"
        )
        return replace(kept, status=Status.STATIONARY, message=message)

    def restore_feasibility(self, inputs: NlpInputs, failed: NlpOutcome) -> NlpOutcome:
        """Find the least violating trajectory; from a feasible one, run the backend again."""
        least = self._least_violating(inputs)
        if least is None:
            return failed
        found = replace(failed, results=(*failed.results, least.result))
        if least.violation <= _FEASIBLE:
            return self._run_to_an_optimum(replace(inputs, w0=least.result.w)).after(found)
        message = self._verdict.where(least.result, inputs.data, least.violation, least.row)
        return replace(found, status=Status.INFEASIBLE, message=message)

    def _least_violating(self, inputs: NlpInputs) -> LeastViolation | None:
        """Find the least violation, again from perturbed controls where some did not move.

        What stands still by symmetry, as at the kink of an absolute value, may hide a way out.
        """
        least = self._restoration.least_violating(inputs.w0, inputs.bounds, inputs.p)
        if least is None or least.violation <= _FEASIBLE or not self.transcription.ocp.model.nu:
            return least
        hidden = self._hidden(inputs, least.result.w)
        if not hidden.any():
            return least
        w0 = perturbed(self.transcription, inputs, least.result.w, hidden)
        other = self._restoration.least_violating(w0, inputs.bounds, inputs.p)
        return other if other and other.violation < least.violation else least

    def _hidden(self, inputs: NlpInputs, w: np.ndarray) -> np.ndarray:
        """Return which controls did not move, though no bound kept them, bool (nu,)."""
        still = unmoved(self.transcription, inputs, w)
        return still & ~at_bounds(self.transcription, inputs, w)

    def solve_from_others(
        self, first: NlpInputs, failed: NlpOutcome, others: Iterable[OtherStart], started: float
    ) -> NlpOutcome:
        """Solve from other first iterates, until one succeeds or the time limit has passed."""
        tried: list[OtherStart] = []
        begun, results = [first.w0], failed.results
        for other in others:
            if perf_counter() - started > self.nlp.backend.time_limit:
                break
            inputs = self._inputs(other.make(), first.data)
            if any(np.array_equal(inputs.w0, earlier) for earlier in begun):
                continue
            outcome = self._run_to_an_optimum(inputs)
            tried.append(other)
            begun.append(inputs.w0)
            is_better = outcome.status.is_success or (
                failed.status is Status.DIVERGED and outcome.status is Status.INACCURATE
            )
            if is_better:
                message = outcome.message
                if outcome.status.is_success:
                    said = f"from {other.words}; from the first iterate: {failed.status.name}"
                    message = f"{message}; {said}" if message else said
                results = (*results, *outcome.results)
                return NlpOutcome(results, outcome.status, message)
            results = (*outcome.results, *results)
        times = ", ".join(f"{other.duration:.4g} s" for other in tried if other.duration)
        said = f"guesses of the final time of {times} lead nowhere either" if times else ""
        message = "; ".join(part for part in (failed.message, said) if part)
        return NlpOutcome(results, failed.status, message)

    # -- when to enter a phase -------------------------------------------------------------------

    def _run_to_an_optimum(self, inputs: NlpInputs, nlp: Nlp | None = None) -> NlpOutcome:
        """Run from a first iterate, and from perturbed controls where some did not move."""
        chosen, problem = nlp or self.nlp, self.transcription
        first, answering = self.first_solve(inputs, chosen)
        if nlp is None and self._has_dependent_rows(inputs, first, answering):
            return self._run_to_an_optimum(inputs, self._for_dependent_rows).after(first)
        if first.status is not Status.SOLVED or not problem.ocp.model.nu:
            return first
        still = unmoved(problem, inputs, first.last.w)
        if still.all():
            return self.solve_from_perturbed(inputs, first, answering)
        hidden = self._hidden(inputs, first.last.w)
        if not hidden.any():
            return first
        return self.solve_from_some_perturbed(inputs, first, answering, hidden)

    def _hands_over(self, nlp: Nlp) -> bool:
        """Whether IPOPT runs where this backend fails."""
        return nlp.backend.name == "native" and self.feasibility_restoration

    def _is_handed_over(self, outcome: NlpOutcome) -> bool:
        """Whether the native solver has failed, not for lack of time nor at the first iterate."""
        is_failure = outcome.status in _MAYBE_FIRST_ITERATE and not outcome.last.success
        return is_failure and not outcome.is_undefined

    def _has_dependent_rows(self, inputs: NlpInputs, outcome: NlpOutcome, nlp: Nlp) -> bool:
        """Whether IPOPT failed close to the constraints, with multipliers without bound."""
        if outcome.status not in (Status.FAILED, Status.ITERATION_LIMIT):
            return False
        last, is_ipopt = outcome.last, nlp.backend.name == "ipopt"
        violation, _ = self.transcription.worst(last.w, last.g, inputs.bounds)
        unbounded = np.abs(last.lam_g).max(initial=0.0) > _UNBOUNDED
        return is_ipopt and bool(unbounded) and violation <= _CLOSE

    def _is_lower(self, inputs: NlpInputs, second: NlpOutcome, first: NlpOutcome) -> bool:
        """Whether the constraints still hold and the cost has fallen."""
        before, after = first.last, second.last
        violation, _ = self.transcription.worst(after.w, after.g, inputs.bounds)
        has_fallen = after.cost < before.cost - _LOWER * (1.0 + abs(before.cost))
        return violation <= _FEASIBLE and has_fallen

    def _may_be_infeasible(self, outcome: NlpOutcome) -> bool:
        ocp = self.transcription.ocp
        is_constrained = bool(ocp.constraints) or ocp.state_bounds.is_active
        return (
            self.feasibility_restoration and is_constrained and outcome.status in _MAYBE_INFEASIBLE
        )

    def _may_start_elsewhere(self, outcome: NlpOutcome, data: RunData) -> bool:
        return (
            self.feasibility_restoration
            and outcome.status in _MAYBE_FIRST_ITERATE
            and not outcome.is_undefined
            and not start_violation(self.transcription.ocp, data)
        )

    # -- what the phases use ---------------------------------------------------------------------

    @cached_property
    def _restoration(self) -> FeasibilityRestoration:
        return FeasibilityRestoration(self.transcription, self.nlp.backend.time_limit)

    @cached_property
    def _verdict(self) -> NlpVerdict:
        return NlpVerdict(self.transcription, self.nlp, self.accuracy, self.state_error)

    @cached_property
    def _for_dependent_rows(self) -> Nlp:
        """IPOPT for the same program, with a regularised linear system."""
        backend = replace(self.nlp.backend, name="ipopt", dependent_rows=True)
        return backend.build(self.transcription)

    @cached_property
    def _ipopt(self) -> Nlp:
        """IPOPT for the same program, built where another's answer may be a saddle, or is none."""
        if isinstance(self.nlp, NativeNlp):
            return self.nlp.ipopt
        return replace(self.nlp.backend, name="ipopt").build(self.transcription)

    def _inputs(self, w0: np.ndarray, data: RunData) -> NlpInputs:
        bounds = self.transcription.bounds(data)
        w0 = np.clip(w0, bounds["lbx"], bounds["ubx"])
        return NlpInputs(w0, self.transcription.data_vector(data), bounds, data)

    def _run(self, nlp: Nlp, inputs: NlpInputs, w: np.ndarray) -> NlpOutcome:
        """Run a backend from an iterate."""
        warm = inputs.warm if w is inputs.w0 else None
        result = nlp.solve(w, inputs.p, inputs.bounds, warm)
        verdict = self._verdict if nlp is self.nlp else replace(self._verdict, nlp=nlp)
        judged = verdict.judge(inputs, result)
        outcome = NlpOutcome((judged.result,), judged.status, judged.message)
        is_handed_over = self._hands_over(self.nlp) and nlp is not self.nlp
        return outcome.told_by(_HANDED_OVER) if is_handed_over else outcome

    def times(self, result: NlpResult, data: RunData) -> np.ndarray:
        """Return the instants of the grid [s]."""
        return self._verdict.times(result, data)
