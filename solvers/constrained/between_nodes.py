"""Path constraints that hold between the nodes too: tightened at the nodes until they do."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp import (
    OCP,
    Box,
    Constraint,
    Grid,
    InitialGuess,
    Program,
    Signal,
    Solution,
    Status,
    UnsupportedProblem,
    evaluate,
)
from ocp.internal import (
    BuiltProgram,
    Epigraph,
    ScalingSolver,
    check_instance,
    check_positive,
    check_whole,
    cut,
    judged,
    number_of,
    with_row_sizes,
)
from solvers.constrained.standard_form import StandardForm
from solvers.direct.multiple_shooting import MultipleShooting

_MARGIN = "margin between the nodes"
# How often the intervals are halved before a failure is reported.
_REFINEMENTS = 2


@dataclass(frozen=True)
class BetweenNodes(ScalingSolver):
    r"""A direct solver whose path constraints hold between the nodes as well.

    A direct method imposes path inequalities and state bounds at its nodes. Here they are

    .. math:: c(x_k, u_k, t_k) + \delta_k \le 0

    with margins δ, a signal, so that the inner program is built once. After each run δ grows
    near every node by what the referee finds violated there, between the nodes. Two or three
    runs are enough where the constraint only bulges. Where margins do not help, as where the
    trajectory jumps *through* an obstacle from one node to the next, the intervals are halved,
    twice at most, before a failure is reported.

    Equations along the path get no margin: none corrects what a held control does to them
    between the nodes. A terminal constraint that the exact dynamics miss, since the integrator
    is too coarse, is ``INACCURATE``.

    Args:
        inner: the direct solver.
        tolerance: on the referee's violation, in the units of the constraints; in their sizes
            where the problem is scaled, see ``Solution.sizes``.
        max_rounds: limit of runs of the inner solver on each grid.
    """

    inner: MultipleShooting = field(default_factory=MultipleShooting)
    tolerance: float = 1e-6
    max_rounds: int = 15

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        check_instance(self.inner, MultipleShooting, "between nodes: inner")
        if isinstance(self.inner.intervals, Grid) or self.inner.blocks:
            raise UnsupportedProblem(
                "between nodes: it halves equal intervals with a control each; its inner solver "
                "takes no Grid and no blocks"
            )
        check_whole(self.max_rounds, "between nodes: max_rounds")
        check_positive(self.tolerance, "between nodes: tolerance")

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "BetweenNodes":
        """Set what is left open; see ``Solver``."""
        inner = self.inner.for_control_loop(compiled=compiled, time_limit=time_limit)
        return replace(self, inner=inner)

    def smooth_form(self, ocp: OCP) -> Epigraph | None:
        """Replace what the inner solver would."""
        return self.inner.smooth_form(ocp)

    def least_violating(self, ocp: OCP) -> Program | None:
        """Build what the inner solver would, at its nodes."""
        return self.inner.least_violating(ocp)

    def refuse_written(self, ocp: OCP) -> None:
        """Refuse soft constraints: their slack is held from node to node, and so is what it allows.

        Raises:
            UnsupportedProblem: naming the constraint.
        """
        for c in ocp.at("path"):
            if c.soft is not None:
                raise UnsupportedProblem(
                    f"{ocp.name}: '{c.name}' is soft: it has a price between the nodes and is not "
                    f"held there; use {type(self.inner).__name__} itself"
                )

    def prepare(self, ocp: OCP) -> "BetweenNodesProgram":
        """Give every path inequality and state bound its margin, and build that.

        Raises:
            UnsupportedProblem: in discrete time, where nothing lies between the nodes.
        """
        check_instance(ocp, OCP, "between nodes: the problem")
        if ocp.model.is_discrete:
            raise UnsupportedProblem(
                f"{ocp.name}: the model is discrete in time, nothing lies between its nodes; "
                f"use {self.inner!r} itself"
            )
        rows = StandardForm.along(ocp)
        tightened = _tightened(ocp, rows, number_of(self.inner.intervals))
        return BetweenNodesProgram(self, ocp, rows, self.inner.unjudged().prepare(tightened))


@dataclass(frozen=True, eq=False)
class BetweenNodesProgram(BuiltProgram):
    """A tightened problem, built by the inner solver.

    Attributes:
        rows: its path constraints and state bounds.
        inner: the program of the tightened problem.
    """

    solver: BetweenNodes
    rows: StandardForm
    inner: Program

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Run, evaluate, widen the margins, and repeat; on finer grids where that fails."""
        started, program = perf_counter(), self
        given = {"x0": x0, "t0": t0}
        rounds = self._tighten(given, parameters, guess)
        runs = rounds.runs
        for _ in range(_REFINEMENTS):
            if not rounds.may_gain_from_refinement:
                break
            program = program._finer
            rounds = program._tighten(given, parameters, runs[-1])
            runs = [*runs, *rounds.runs]
        intervals = number_of(program.solver.inner.intervals)
        status, message = rounds.judge(intervals)
        found = self._solution(runs, status, message, perf_counter() - started)
        return judged(found, self.solver.inner.success_accuracy, between_nodes=False)

    def _tighten(
        self,
        given: Mapping[str, Any],
        parameters: Mapping[str, ArrayLike] | None,
        guess: InitialGuess | None,
    ) -> "_Rounds":
        """Widen the margins on this grid until they suffice or do not help."""
        tolerance, intervals = self.solver.tolerance, number_of(self.solver.inner.intervals)
        nodes = np.linspace(0.0, 1.0, intervals + 1)
        margin, runs = np.zeros((len(nodes), self.rows.size)), []
        while True:
            added = {_MARGIN: margin} if self.rows.size else {}
            inner = self.inner.run(**given, parameters={**(parameters or {}), **added}, guess=guess)
            values = {k: v for k, v in inner.parameters.items() if k != _MARGIN}
            runs.append(inner.with_(problem=self.ocp, parameters=values))
            verdict = evaluate(runs[-1])
            excess = np.zeros_like(margin)
            if self.rows.size:
                found = self.rows.worst_near_nodes(verdict, nodes)
                excess = np.where(self.rows.is_equation, 0.0, np.maximum(0.0, found))
            along = float(excess.max(initial=0.0))
            rounds = _Rounds(runs, verdict.violation, verdict.worst, along, margin, tolerance)
            is_done = verdict.violation <= tolerance or len(runs) == self.solver.max_rounds
            if is_done or along <= tolerance or not inner.status.is_success:
                return rounds
            margin = margin + np.where(excess > 0.0, excess + tolerance / 2, 0.0)
            guess = inner

    @cached_property
    def _finer(self) -> "BetweenNodesProgram":
        """The same with half the intervals' length, built at the first use."""
        inner = replace(self.solver.inner, intervals=cut(self.solver.inner.intervals, 2))
        return replace(self.solver, inner=inner).prepare(self.ocp)

    def _solution(
        self, runs: list[Solution], status: Status, message: str, seconds: float
    ) -> Solution:
        """The last run, with the work of all."""
        work = runs[0].work
        for run in runs[1:]:
            work = work + run.work
        return runs[-1].with_(
            solver=repr(self.solver),
            status=status,
            message=message,
            iterations=sum(run.iterations for run in runs),
            work=work,
            solve_time=seconds,
        )


@dataclass(frozen=True, eq=False)
class _Rounds:
    """The runs on one grid.

    Attributes:
        runs: of the inner solver.
        violation: of the last one, by the referee.
        worst: what it violates most.
        along: violation of path inequalities and state bounds alone.
        margin: of the last run.
        tolerance: on the violation.
    """

    runs: list[Solution]
    violation: float
    worst: str
    along: float
    margin: np.ndarray
    tolerance: float

    @property
    def may_gain_from_refinement(self) -> bool:
        """Whether margins or the grid may be why it failed."""
        last = self.runs[-1]
        if last.status.is_success:
            return self.violation > self.tolerance
        return bool(self.margin.any()) or last.status is Status.INACCURATE

    def judge(self, intervals: int) -> tuple[Status, str]:
        """Return status and message."""
        last = self.runs[-1]
        if last.status.is_success and self.violation <= self.tolerance:
            return last.status, last.message
        if last.status.is_success and self.along <= self.tolerance:
            return Status.INACCURATE, (
                f"{self.worst} is missed by {self.violation:.3g} when the controls are integrated "
                f"exactly: the integrator is too coarse on {intervals} intervals; take more "
                "intervals or more integration steps"
            )
        if last.status.is_success:
            said = f"{self.worst} is violated by {self.violation:.3g} between the nodes"
            return Status.NO_PROGRESS, f"{said} of {intervals} intervals"
        if not self.margin.any():
            return last.status, last.message
        more = f"with margins up to {self.margin.max():.3g} for what happens between the nodes"
        return last.status, f"{last.message} {more} of {intervals} intervals".strip()


def _tightened(ocp: OCP, rows: StandardForm, intervals: int) -> OCP:
    """Return the problem with margins; the constraints keep their names."""
    if not rows.size:
        return ocp
    margin = ca.SX.sym("margin", rows.size)
    shifted = ca.if_else(ca.DM(rows.is_equation.astype(float)), rows.c, rows.c + margin)
    constraints = [c for c in ocp.constraints if c.at != "path"]
    sizes = {}
    for name, group in groupby(range(rows.size), key=lambda i: rows.rows[i].name):
        members = list(group)
        lower = np.where(rows.is_equation[members], 0.0, -np.inf)
        constraints.append(Constraint(name, shifted[members], lower, 0.0))
        sizes[name] = np.array([rows.rows[i].unit for i in members])
    samples = np.zeros((intervals + 1, rows.size))
    tightened = replace(
        ocp,
        state_bounds=Box(),
        constraints=tuple(constraints),
        parameters=(*ocp.parameters, Signal(_MARGIN, margin, samples, hold="linear")),
    )
    return with_row_sizes(tightened, sizes)
