"""Runs of the inner solver on the relaxed problem, and what the referee finds in them."""

from dataclasses import dataclass, field

import numpy as np

from ocp import OCP, Evaluation, InitialGuess, Program, Solution, Status, Work, evaluate
from ocp.internal import RunData
from solvers.constrained.multipliers import Multipliers
from solvers.constrained.relaxed_problem import RelaxedProblem

# A run that failed still counts where the referee's states differ from the solver's by less than
# this, relative to 1 + abs(x).
_TRAJECTORY = 1e-2
# A round improves where it leaves less than this share of the smallest violation so far.
_BETTER = 0.9


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
        """Whether multipliers can be updated from it: the dynamics hold, at least roughly."""
        if not np.isfinite(self.verdict.cost) or self.inner.status is Status.DIVERGED:
            return False
        near = _TRAJECTORY * (1.0 + np.abs(self.answer.x).max())
        return self.inner.status.is_success or self.verdict.defect <= near

    @property
    def violation(self) -> float:
        """The largest that the referee finds."""
        return self.verdict.violation

    @property
    def complementarity(self) -> float:
        """Multipliers times the values of their constraints, relative to 1 + abs(cost)."""
        return self.complementarity_under(self.used)

    def complementarity_under(self, multipliers: Multipliers) -> float:
        """The same with other multipliers than those of the run."""
        weight = multipliers.weight_of(self.path, self.end, self.answer.duration)
        return weight / (1.0 + abs(self.verdict.cost))


@dataclass(eq=False)
class MultiplierRounds:
    """The rounds so far.

    Attributes:
        rounds: those that gave a trajectory.
        lost: those that gave none.
        best: of the rounds, the one with the least violation.
        stalled: rounds since the violation last improved.
    """

    rounds: list[MultiplierRound] = field(default_factory=list)
    lost: list[MultiplierRound] = field(default_factory=list)
    best: MultiplierRound | None = None
    stalled: int = 0

    @property
    def last(self) -> MultiplierRound | None:
        """The last round that gave a trajectory."""
        return self.rounds[-1] if self.rounds else None

    @property
    def count(self) -> int:
        """Runs of the inner solver."""
        return len(self.rounds) + len(self.lost)

    @property
    def work(self) -> Work:
        """The work of all runs."""
        return sum((r.inner.work for r in [*self.rounds, *self.lost]), Work())

    def add(self, here: MultiplierRound, tolerance: float) -> None:
        """Add a round that gave a trajectory."""
        now = max(here.violation, tolerance)
        before = max(self.best.violation, tolerance) if self.best else np.inf
        self.stalled = 0 if now < _BETTER * before else self.stalled + 1
        # Among those within the tolerance the last has the best multipliers.
        self.best = here if now <= before else self.best
        self.rounds.append(here)


@dataclass(frozen=True, eq=False)
class RelaxedProgram:
    """The relaxed problem as the inner solver built it.

    Attributes:
        ocp: the problem itself.
        relaxed: the problem without its constraints.
        inner: the program of the inner solver for the relaxed problem.
        intervals: on each of which the multipliers are linear in time.
    """

    ocp: OCP
    relaxed: RelaxedProblem
    inner: Program
    intervals: int

    def run(self, used: Multipliers, data: RunData, guess: InitialGuess | None) -> MultiplierRound:
        """Solve the relaxed problem with these multipliers, and evaluate its controls."""
        given = {**data.values.as_dict(), **used.parameters()}
        inner = self.inner.run(x0=data.x0, t0=data.t0, parameters=given, guess=guess)
        kind = "linear" if inner.control_kind == "extremal" else inner.control_kind
        answer = rescaled(inner, 1.0 / used.scale).with_(
            problem=self.ocp, control_kind=kind, parameters=data.values.as_dict()
        )
        verdict = evaluate(answer)
        if not np.isfinite(verdict.cost):
            return MultiplierRound(used, inner, answer, verdict, used.path, used.end)
        nodes = np.linspace(0.0, 1.0, self.intervals + 1)
        path = self.relaxed.path.worst_near_nodes(verdict, nodes)
        end = self.relaxed.end.at_final(verdict)
        return MultiplierRound(used, inner, answer, verdict, path, end)


def rescaled(solution: Solution, factor: float) -> Solution:
    """Return the same trajectory, where the cost is multiplied by a factor."""
    return solution.with_(costate=factor * solution.costate)
