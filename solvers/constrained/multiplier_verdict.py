"""Why the iteration on the multipliers ends: status and message."""

from dataclasses import dataclass

import numpy as np

from ocp import Status
from solvers.constrained.multiplier_round import MultiplierRound, MultiplierRounds, RelaxedProgram
from solvers.constrained.multiplier_rule import MultiplierRule

# So many rounds in a row without improvement end the iteration.
_PATIENCE = 6
# At a solution the multipliers' term vanishes. Where it stays above this share of the cost, and
# the violation too, the constraints are taken to be infeasible.
_OUTGROWN = 0.1


@dataclass(frozen=True, eq=False)
class MultiplierVerdict:
    """Judges the rounds.

    Attributes:
        program: of the relaxed problem.
        rule: for the updates, with the tolerance on the violation.
        complementarity: the largest accepted.
    """

    program: RelaxedProgram
    rule: MultiplierRule
    complementarity: float

    def decided(self, rounds: MultiplierRounds) -> tuple[Status, str] | None:
        """Return status and message where the last round ends the iteration."""
        here = rounds.rounds[-1]
        feasible = here.violation <= self.rule.tolerance
        optimal = feasible and here.complementarity <= self.complementarity
        if len(rounds.rounds) == 1 and self._start_is_outside(here):
            return Status.INFEASIBLE, self._where(here)
        if optimal and here.inner.status.is_success:
            return here.inner.status, here.inner.message
        at_largest = here.used.penalty >= self.rule.largest_penalty
        if rounds.stalled <= _PATIENCE or not (feasible or at_largest):
            return None
        if optimal:
            return here.inner.status, here.inner.message
        if here.inner.status.is_success:
            return self.infeasible_or(rounds, Status.NO_PROGRESS)
        return self.failed(rounds, here)

    def failed(self, rounds: MultiplierRounds, here: MultiplierRound) -> tuple[Status, str]:
        """Return why a round ends the iteration in which the inner solver failed."""
        status = here.inner.status
        otherwise = Status.FAILED if status.is_success else status
        status, message = self.infeasible_or(rounds, otherwise)
        if status is Status.INFEASIBLE:
            return status, message
        why = f"the inner solver ends with {here.inner.status.name} at penalty "
        why = f"{why}{here.used.penalty:.3g} {here.inner.message}".strip()
        return status, f"{message}; {why}" if message else why

    def infeasible_or(self, rounds: MultiplierRounds, otherwise: Status) -> tuple[Status, str]:
        """Return INFEASIBLE where the rounds show it, else a status; with what is violated."""
        best = rounds.best
        if best is None or best.violation <= self.rule.tolerance:
            return otherwise, ""
        # A solver that mostly fails has shown nothing about the problem.
        solved = sum(r.inner.status.is_success for r in rounds.rounds) >= len(rounds.rounds) / 2
        outgrown = rounds.rounds[-1].complementarity > _OUTGROWN
        return Status.INFEASIBLE if outgrown and solved else otherwise, self._where(best)

    def _start_is_outside(self, here: MultiplierRound) -> bool:
        """Whether the given start violates a row that only the start decides."""
        if self.program.ocp.has_free_start:
            return False
        return self.program.relaxed.path.start_violation(here.verdict) > self.rule.tolerance

    def _where(self, here: MultiplierRound) -> str:
        if here.violation <= self.rule.tolerance:
            return ""
        rows, t = self.program.relaxed.path, here.answer.t
        times = np.linspace(t[0], t[-1], self.program.intervals + 1)
        return rows.worst_in_words(here.path, times) or f"{here.verdict.worst} is violated"
