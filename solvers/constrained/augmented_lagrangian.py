"""The augmented Lagrangian: constraints for solvers that take none, met between the nodes too."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, InitialGuess, ProblemError, Program, Solution, Solver, UnsupportedProblem
from ocp.internal import (
    ACCURACY,
    BuiltProgram,
    RunData,
    ScalingSolver,
    check_instance,
    check_positive,
    check_whole,
    judged,
)
from solvers.constrained.multiplier_iteration import MultiplierIteration, MultiplierResult
from solvers.constrained.multiplier_round import RelaxedProgram
from solvers.constrained.multiplier_rule import MultiplierRule
from solvers.constrained.multiplier_verdict import MultiplierVerdict
from solvers.constrained.relaxed_problem import RelaxedProblem


@dataclass(frozen=True)
class AugmentedLagrangian(ScalingSolver):
    r"""Put constraints into the cost, and update multipliers and penalty until they are met.

    The relaxed problem (see ``RelaxedProblem``) is built once by the inner solver. After each of
    its runs the *referee* integrates the controls, and the multipliers at the nodes follow

    .. math::

        \mu_k \leftarrow \max\bigl(0, \mu_k + \rho \, \max_{t \approx t_k} c(t)\bigr)

    with the worst instant of all that are nearer to this node than to another. So at the end
    the constraint holds between the nodes too. The penalty ρ grows where the violation falls
    too slowly.

    It relaxes path constraints, state bounds and terminal constraints, of which a relaxed
    problem has none left; initial constraints, control bounds and a free final time stay with
    the inner solver, which may refuse them. It succeeds when the referee's violation is within
    the tolerance, the complementarity is small and the inner solver succeeds in its last
    run; it is ``INFEASIBLE`` when the start itself violates a constraint, or, a local verdict,
    when a violation stays although the multipliers' term has outgrown the cost, and the inner
    solver succeeds in most of its runs.

    The multipliers are in ``history``: ``"multiplier"`` (N + 1, m) per second, at the nodes,
    and ``"terminal multiplier"``; per round ``"violation"``, ``"complementarity"``,
    ``"penalty"`` and ``"cost"``.

    Source: [Hestenes 1969], [Bertsekas 1982], [Hager 1990]; named in thesis 3.3 and 4.

    Args:
        inner: the solver of the relaxed problems. Give ``IndirectShooting`` about as many
            segments as intervals: a large penalty makes the canonical flow stiff.
        intervals: the multipliers are linear in time on each of these; where the controls are
            held, take as many.
        penalty: ρ of the first round.
        growth: factor by which it is raised.
        largest_penalty: and up to where.
        tolerance: on the referee's violation, in the units of the constraints; in their sizes
            where the problem is scaled, see ``Solution.sizes``.
        complementarity: on :math:`\int \mu |c| dt` relative to 1 + abs(cost).
        max_iterations: limit of rounds.
    """

    inner: Solver
    intervals: int = 75
    penalty: float = 100.0
    growth: float = 10.0
    largest_penalty: float = 1e5
    tolerance: float = 1e-6
    complementarity: float = 1e-4
    max_iterations: int = 60

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        check_instance(self.inner, Solver, "augmented Lagrangian: inner")
        check_whole(self.intervals, "augmented Lagrangian: intervals")
        check_whole(self.max_iterations, "augmented Lagrangian: max_iterations")
        for name in ("penalty", "largest_penalty", "growth"):
            check_positive(getattr(self, name), f"augmented Lagrangian: {name}")
        if self.penalty > self.largest_penalty:
            raise ProblemError(
                f"augmented Lagrangian: penalty <= largest_penalty is needed, not "
                f"{self.penalty}, {self.largest_penalty}"
            )
        if not self.growth > 1.0:
            raise ProblemError(f"augmented Lagrangian: growth = {self.growth}, it must exceed 1")
        for name in ("tolerance", "complementarity"):
            check_positive(getattr(self, name), f"augmented Lagrangian: {name}")

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "AugmentedLagrangian":
        """Set what is left open; see ``Solver``."""
        inner = self.inner.for_control_loop(compiled=compiled, time_limit=time_limit)
        return replace(self, inner=inner)

    def prepare(self, ocp: OCP) -> "AugmentedLagrangianProgram":
        """Relax the problem and let the inner solver build that.

        Raises:
            UnsupportedProblem: if there is nothing to relax, in discrete time, or from the inner
                solver.
        """
        check_instance(ocp, OCP, "augmented Lagrangian: the problem")
        if ocp.model.is_discrete:
            raise UnsupportedProblem(
                f"{ocp.name}: the model is discrete in time, nothing lies between its nodes; "
                "use a direct method"
            )
        relaxed = RelaxedProblem.of(ocp, self.intervals)
        if not relaxed.path.size + relaxed.end.size:
            raise UnsupportedProblem(
                f"{ocp.name}: there is no path, state or terminal constraint to relax; use "
                f"{type(self.inner).__name__} itself"
            )
        inner = self.inner.unjudged().prepare(relaxed.ocp)
        return AugmentedLagrangianProgram(self, ocp, relaxed, inner)


@dataclass(frozen=True, eq=False)
class AugmentedLagrangianProgram(BuiltProgram):
    """A relaxed problem, built by the inner solver.

    Attributes:
        relaxed: the problem without its constraints.
        inner: the program of the inner solver.
    """

    solver: AugmentedLagrangian
    relaxed: RelaxedProblem
    inner: Program

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Alternate between the inner solver and the multipliers."""
        started, s = perf_counter(), self.solver
        data = RunData.of(self.ocp, x0, t0, parameters)
        program = RelaxedProgram(self.ocp, self.relaxed, self.inner, s.intervals)
        rule = MultiplierRule(s.penalty, s.growth, s.largest_penalty, s.tolerance)
        verdict = MultiplierVerdict(program, rule, s.complementarity)
        result = MultiplierIteration(program, rule, verdict, s.max_iterations).run(data, guess)
        found = self._solution(result).with_(solve_time=perf_counter() - started)
        return judged(found, ACCURACY, between_nodes=False)

    def _solution(self, result: MultiplierResult) -> Solution:
        """Return the last round of a success, the least violating one of a failure."""
        done = result.rounds
        shown = done.rounds[-1] if result.status.is_success else done.best or done.lost[-1]
        return shown.answer.with_(
            solver=repr(self.solver),
            status=result.status,
            message=result.message,
            cost=shown.verdict.cost,
            iterations=done.count,
            work=done.work,
            history={
                "multiplier": shown.used.path,
                "terminal multiplier": shown.used.end,
                "penalty": np.array([r.used.penalty for r in done.rounds]),
                "violation": np.array([r.violation for r in done.rounds]),
                "complementarity": np.array([r.complementarity for r in done.rounds]),
                "cost": np.array([r.verdict.cost for r in done.rounds]),
            },
        )
