"""The loop of the augmented Lagrangian: a run of the inner solver, an update of the multipliers."""

from dataclasses import dataclass
from typing import NamedTuple

from ocp import InitialGuess, Solution, Status
from ocp.internal import RunData
from solvers.constrained.multiplier_round import (
    MultiplierRound,
    MultiplierRounds,
    RelaxedProgram,
    rescaled,
)
from solvers.constrained.multiplier_rule import MultiplierRule
from solvers.constrained.multiplier_verdict import MultiplierVerdict
from solvers.constrained.multipliers import Multipliers

# Where the inner solver fails the multipliers moved too far: so often the step is halved.
_RETREATS = 6


class MultiplierResult(NamedTuple):
    """How the iteration ended, and its rounds."""

    status: Status
    message: str
    rounds: MultiplierRounds


@dataclass(frozen=True, eq=False)
class MultiplierIteration:
    """Runs of the inner solver in turns with updates of the multipliers.

    Attributes:
        program: of the relaxed problem.
        rule: for the updates.
        verdict: when to stop, and why.
        max_iterations: limit of runs.
    """

    program: RelaxedProgram
    rule: MultiplierRule
    verdict: MultiplierVerdict
    max_iterations: int

    def run(self, data: RunData, guess: InitialGuess | None) -> MultiplierResult:
        """Iterate until the verdict is known; return it with all rounds."""
        rounds, failures = MultiplierRounds(), 0
        there = self.rule.first(self.program.relaxed, self.program.intervals)
        while rounds.count < self.max_iterations:
            here = self.program.run(there, data, _warm_start(rounds.last, there) or guess)
            if not here.is_trajectory:
                rounds.lost.append(here)
                failures += 1
                if failures > _RETREATS:
                    return MultiplierResult(*self.verdict.failed(rounds, here), rounds)
                there = self.rule.retreat(there, rounds.last)
                continue
            failures, before = 0, rounds.last
            rounds.add(here, self.rule.tolerance)
            decided = self.verdict.decided(rounds)
            if decided:
                return MultiplierResult(*decided, rounds)
            there = self.rule.after(here, before)
        return MultiplierResult(*self.verdict.infeasible_or(rounds, Status.ITERATION_LIMIT), rounds)


def _warm_start(last: MultiplierRound | None, there: Multipliers) -> Solution | None:
    """Return the last trajectory, its costates in the scale of the next relaxed cost."""
    return rescaled(last.inner, there.scale / last.used.scale) if last else None
