"""Round by round towards the multipliers: the loop of the augmented Lagrangian."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ocp import Evaluation, InitialGuess, Solution, Status, Work, evaluate
from ocp.internal import RunData
from solvers.constrained.multipliers import Multipliers

if TYPE_CHECKING:
    from solvers.constrained.augmented_lagrangian import AugmentedLagrangianProgram

# A round that leaves more than this share of the violation asks for a larger penalty.
_ENOUGH = 0.25
# Rounds without a violation this much smaller than the best, at the largest penalty, are enough.
_PATIENCE, _BETTER = 6, 0.9
# Where the inner solver fails its problem moved too far; so often the way there is halved.
_RETREATS = 6
# States this far from what the controls really do are no trajectory (relative to 1 + abs(x)).
_TRAJECTORY = 1e-2
# A violation that a round leaves this much of creeps; how far inside, in multiples of it, one
# may then aim. What that costs is part of the gap.
_CREEPING, _FURTHEST = 0.75, 3.0
# At a solution the multipliers' term vanishes. Where it stays above this share of the cost, and
# the violation too, the multipliers grow against something that does not yield.
_OUTGROWN = 0.1


@dataclass(frozen=True, eq=False)
class MultiplierRound:
    """One run of the inner solver, and what the referee says of its controls.

    Attributes:
        used: the multipliers of the run.
        inner: what the inner solver returned.
        answer: the same controls as a solution of the problem itself.
        verdict: of the referee.
        path: worst value of every row near every node, (N + 1, m).
        end: values of the terminal rows, (k,).
    """

    used: Multipliers
    inner: Solution
    answer: Solution
    verdict: Evaluation
    path: np.ndarray
    end: np.ndarray

    @property
    def is_trajectory(self) -> bool:
        """Whether there is something to learn from: a descent cut short yes, a lost Newton no."""
        if not np.isfinite(self.verdict.cost) or self.inner.status is Status.DIVERGED:
            return False
        near = _TRAJECTORY * (1.0 + np.abs(self.answer.x).max())
        return self.inner.status.is_success or self.verdict.defect <= near

    @property
    def violation(self) -> float:
        """The largest that the referee finds."""
        return self.verdict.violation

    @property
    def gap(self) -> float:
        """Multipliers times what is left of their constraints, relative to 1 + abs(cost)."""
        return self.gap_under(self.used)

    def gap_under(self, multipliers: Multipliers) -> float:
        """The same with other multipliers than those of the run."""
        left = multipliers.weight_of(self.path, self.end, self.answer.duration)
        return left / (1.0 + abs(self.verdict.cost))


class MultiplierIteration:
    """The state of one run: the rounds so far, the best of them, the work of all."""

    def __init__(self, program: "AugmentedLagrangianProgram", data: RunData) -> None:
        self.program, self.data, self.solver = program, data, program.solver
        self.rounds: list[MultiplierRound] = []
        self.best: MultiplierRound | None = None
        self.lost: MultiplierRound | None = None
        self.work, self.runs = Work(), 0
        # Half a tolerance inside: what converges from outside then gets there.
        self.aim = program.solver.tolerance / 2

    # -- the loop --------------------------------------------------------------------------

    def climb(self, guess: InitialGuess | None) -> tuple[Status, str]:
        """Go round until a test holds; return the status and its message."""
        relaxed, stalled, retreats = self.program.relaxed, 0, 0
        there = Multipliers.zero(relaxed, self.solver.intervals, self.solver.penalty)
        while self.runs < self.solver.max_iterations:
            here = self._round(there, self._scaled(there, guess))
            if not here.is_trajectory:
                self.lost, retreats = here, retreats + 1
                if retreats > _RETREATS:
                    return self._failed(here)
                there = self._retreat(there)
                continue
            retreats = 0
            stalled = 0 if self._improves(here) else stalled + 1
            self.rounds.append(here)
            decided = self._decided(here, stalled)
            if decided:
                return decided
            there = self._next(here)
        return self._infeasible_or(Status.ITERATION_LIMIT)

    def _scaled(self, there: Multipliers, guess: InitialGuess | None) -> InitialGuess | None:
        """Return where a round starts: at the last one, its costates in the scale of this one."""
        if not self.rounds:
            return guess
        last = self.rounds[-1]
        return _rescaled(last.inner, there.scale / last.used.scale)

    def _retreat(self, lost: Multipliers) -> Multipliers:
        """Go halfway back to the last round; before the first one, a lower penalty."""
        if self.rounds:
            return self.rounds[-1].used.halfway(lost)
        return replace(lost, penalty=lost.penalty / self.solver.growth)

    def _round(self, used: Multipliers, guess: InitialGuess | None) -> MultiplierRound:
        program, relaxed, data = self.program, self.program.relaxed, self.data
        given = {**data.values.as_dict(), **used.parameters()}
        inner = program.inner.run(x0=data.x0, t0=data.t0, parameters=given, guess=guess)
        self.work, self.runs = self.work + inner.work, self.runs + 1
        kind = "linear" if inner.control_kind == "extremal" else inner.control_kind
        answer = _rescaled(inner, 1.0 / used.scale).with_(
            problem=program.ocp, control_kind=kind, parameters=data.values.as_dict()
        )
        verdict = evaluate(answer)
        if not np.isfinite(verdict.cost):
            return MultiplierRound(used, inner, answer, verdict, used.path, used.end)
        nodes = np.linspace(0.0, 1.0, self.solver.intervals + 1)
        path = relaxed.path.worst_near_nodes(verdict, nodes)
        return MultiplierRound(used, inner, answer, verdict, path, relaxed.end.at_final(verdict))

    def _improves(self, here: MultiplierRound) -> bool:
        """Keep the least violating round; tell whether this one is it, by a margin."""
        floor = self.solver.tolerance
        before = self.best.violation if self.best else np.inf
        # Among those within the tolerance the last has the best multipliers.
        if max(here.violation, floor) <= max(before, floor):
            self.best = here
        return max(here.violation, floor) < _BETTER * max(before, floor)

    def _next(self, here: MultiplierRound) -> Multipliers:
        """Multipliers of first order; a larger penalty where the violation falls too slowly."""
        s = self.solver
        before = self.rounds[-2].violation if len(self.rounds) > 1 else np.inf
        slow = here.violation > max(_ENOUGH * before, s.tolerance)
        grown = min(here.used.penalty * s.growth, s.largest_penalty)
        penalty = grown if slow else here.used.penalty
        if here.used.penalty >= s.largest_penalty and here.violation > _CREEPING * before:
            # Multipliers of single instants converge slowly: aim further and further inside.
            self.aim = min(2.0 * self.aim, _FURTHEST * here.violation)
        there = here.used.updated(here.path, here.end, aim=self.aim, penalty=penalty)
        # The relaxed cost stays of the order of the cost: an inner solver can then meet its own
        # tolerance while the multipliers' term is many times the cost. No gap, no scaling.
        return replace(there, scale=1.0 / (1.0 + here.gap_under(there)))

    # -- the verdict -----------------------------------------------------------------------

    def _decided(self, here: MultiplierRound, stalled: int) -> tuple[Status, str] | None:
        s, feasible = self.solver, here.violation <= self.solver.tolerance
        if len(self.rounds) == 1 and self._start_is_outside(here):
            return Status.INFEASIBLE, self._where(here)
        if feasible and here.gap <= s.complementarity and here.inner.status.is_success:
            return here.inner.status, here.inner.message
        at_the_top = here.used.penalty >= s.largest_penalty
        if stalled <= _PATIENCE or not (feasible or at_the_top):
            return None
        if feasible and here.gap <= s.complementarity:
            return here.inner.status, here.inner.message
        if here.inner.status.is_success:
            return self._infeasible_or(Status.NO_PROGRESS)
        return self._failed(here)

    def _failed(self, here: MultiplierRound) -> tuple[Status, str]:
        status = here.inner.status
        status, message = self._infeasible_or(Status.FAILED if status.is_success else status)
        if status is Status.INFEASIBLE:
            return status, message
        why = f"the inner solver ends with {here.inner.status.name} at penalty "
        why = f"{why}{here.used.penalty:.3g} {here.inner.message}".strip()
        return status, f"{message}; {why}" if message else why

    def _infeasible_or(self, otherwise: Status) -> tuple[Status, str]:
        best = self.best
        if best is None or best.violation <= self.solver.tolerance:
            return otherwise, ""
        # A solver that mostly fails has shown nothing about the problem.
        solved = sum(r.inner.status.is_success for r in self.rounds) >= len(self.rounds) / 2
        outgrown = self.rounds[-1].gap > _OUTGROWN
        return Status.INFEASIBLE if outgrown and solved else otherwise, self._where(best)

    def _start_is_outside(self, here: MultiplierRound) -> bool:
        """Whether the given start violates a row that only the start decides."""
        if self.program.ocp.has_free_start:
            return False
        return self.program.relaxed.path.start_violation(here.verdict) > self.solver.tolerance

    def _where(self, here: MultiplierRound) -> str:
        if here.violation <= self.solver.tolerance:
            return ""
        rows, times = (
            self.program.relaxed.path,
            np.linspace(here.answer.t[0], here.answer.t[-1], self.solver.intervals + 1),
        )
        return rows.worst_in_words(here.path, times) or f"{here.verdict.worst} is violated"

    # -- out -------------------------------------------------------------------------------

    def solution(self, status: Status, message: str, seconds: float) -> Solution:
        """Return the last round of a success, the least violating one of a failure."""
        last = self.rounds[-1] if status.is_success else self.best or self.lost
        assert last is not None  # there was a first round
        return last.answer.with_(
            solver=repr(self.solver),
            status=status,
            message=message,
            cost=last.verdict.cost,
            iterations=self.runs,
            work=self.work,
            history={
                "multiplier": last.used.path,
                "terminal multiplier": last.used.end,
                "penalty": np.array([r.used.penalty for r in self.rounds]),
                "violation": np.array([r.violation for r in self.rounds]),
                "complementarity": np.array([r.gap for r in self.rounds]),
                "cost": np.array([r.verdict.cost for r in self.rounds]),
            },
            solve_time=seconds,
        )


def _rescaled(solution: Solution, factor: float) -> Solution:
    """The same motion, where the cost is multiplied by a factor."""
    return solution.with_(costate=factor * solution.costate)
