"""The rule by which multipliers and penalty follow from a round."""

from dataclasses import dataclass, replace

import numpy as np

from solvers.constrained.multiplier_round import MultiplierRound
from solvers.constrained.multipliers import Multipliers
from solvers.constrained.relaxed_problem import RelaxedProblem

# The penalty grows after a round that leaves more than this share of the violation before it.
_ENOUGH = 0.25
# At the largest penalty, after a round that leaves more than this share of the violation, the
# updates aim further inside, by at most this multiple of the violation. It costs complementarity.
_SLOW, _FURTHEST = 0.75, 3.0


@dataclass(frozen=True)
class MultiplierRule:
    """Multipliers of first order, and a penalty that grows; see ``AugmentedLagrangian``.

    Attributes:
        penalty: of the first round.
        growth: factor by which it is raised.
        largest_penalty: and up to where.
        tolerance: on the violation.
    """

    penalty: float
    growth: float
    largest_penalty: float
    tolerance: float

    def first(self, relaxed: RelaxedProblem, intervals: int) -> Multipliers:
        """Return zero multipliers and the first penalty."""
        # Half a tolerance inside: what converges from outside then gets within the tolerance.
        return Multipliers.zero(relaxed, intervals, self.penalty, aim=self.tolerance / 2)

    def after(self, here: MultiplierRound, before: MultiplierRound | None) -> Multipliers:
        """Return the multipliers for the next round, from the last one and the one before it."""
        used, aim = here.used, here.used.aim
        violation = before.violation if before else np.inf
        slow = here.violation > max(_ENOUGH * violation, self.tolerance)
        grown = min(used.penalty * self.growth, self.largest_penalty)
        if used.penalty >= self.largest_penalty and here.violation > _SLOW * violation:
            # Multipliers of single instants converge slowly.
            aim = min(2.0 * aim, _FURTHEST * here.violation)
        penalty = grown if slow else used.penalty
        there = used.updated(here.path, here.end, aim=aim, penalty=penalty)
        # The relaxed cost stays of the order of the cost: an inner solver can then meet its own
        # tolerance while the multipliers' term is many times the cost.
        return replace(there, scale=1.0 / (1.0 + here.complementarity_under(there)))

    def retreat(self, lost: Multipliers, last: MultiplierRound | None) -> Multipliers:
        """Return the multipliers for another try where the inner solver failed with ``lost``.

        Halfway back to those of the last round that gave a trajectory; before the first one a
        lower penalty.
        """
        if last is not None:
            return last.used.halfway(lost)
        return replace(lost, penalty=lost.penalty / self.growth)
