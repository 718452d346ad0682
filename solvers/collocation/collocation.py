"""Direct collocation: the problem on Radau or Gauss points, by an interior-point method."""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import ClassVar

import numpy as np

from ocp import OCP, Grid, InitialGuess, Program, Solution, Status, UnsupportedProblem
from ocp.internal import (
    AlgebraicControls,
    Epigraph,
    ImposedRows,
    MethodProgram,
    NormalForm,
    RunData,
    RunResult,
    ScalingSolver,
    WithSlacks,
    check_flag,
    check_instance,
    check_intervals,
    check_positive,
    elevated,
    epigraph,
    least_violating,
    segment_gaps,
)
from solvers.collocation.collocated_problem import CollocatedProblem, CollocationUnknowns
from solvers.collocation.collocation_points import CollocationPoints, Family
from solvers.collocation.costates import costates
from solvers.collocation.defects import Defects
from solvers.collocation.mesh import CollocationGrid, Mesh
from solvers.direct.first_trajectory import (
    FirstStates,
    first_duration,
    first_states,
    other_starts,
)
from solvers.direct.nlp_backends import Nlp, NlpBackend
from solvers.direct.nlp_outcome import NlpOutcome
from solvers.direct.nlp_result import NlpResult
from solvers.direct.nlp_run import NlpRun
from solvers.direct.weak_method import weak_method


@dataclass(frozen=True)
class Collocation(ScalingSolver):
    r"""States and controls are polynomials on each interval; the dynamics hold at its points.

    With d points an interval states have degree d and controls d - 1, continuous states and
    discontinuous controls. On smooth problems states, costates and cost at the interval ends
    are of order 2d - 1 (Radau) and 2d (Gauss) in the interval's length.

    Dynamics, path constraints and state bounds hold at the collocation points: inside each
    interval, and with Radau also at its end. So with Gauss only terminal constraints restrict
    the final state, and with neither does a path constraint that contains the control hold at t0.
    A given start that violates a path constraint is ``INFEASIBLE``; a free one meets the state
    bounds and the path constraints without control. Control bounds hold everywhere: the control
    is at each instant a convex combination of coefficients within them. Signals are read at the
    points; their knots are mesh edges where there are intervals enough.

    Source: [Hager 2000; Benson et al. 2006; Garg et al. 2010]; backend [Waechter & Biegler 2006].

    Args:
        intervals: number of intervals, equal but for the knots of signals; or a ``Grid``.
        degree: points an interval, d, 2 to 5.
        points: ``"radau"``: the end of each interval is a point, damps what is stiff; or
            ``"gauss"``: one order more, symmetric in time.
        mesh: intervals of any lengths and degrees, instead of ``intervals`` and ``degree``.
        tolerance: of the optimality conditions.
        max_iterations: limit of the backend.
        accuracy: largest accepted error of a state, relative to 1 + abs(x): by how much the
            dynamics, integrated from node to node, miss the polynomial; a solution beyond it is
            ``INACCURATE``. ``refined`` finds a mesh that meets it.
        verbose: let the backend print.
        time_limit: for each run of the backend [s]; inf: unlimited; None: unlimited, but 10 s in
            ``MPC``.
        feasibility_restoration: see ``MultipleShooting``; off in a control loop.
    """

    takes_phases: ClassVar[bool] = True

    intervals: int | Grid = 25
    degree: int = 4
    points: Family = "radau"
    mesh: Mesh | None = None
    tolerance: float = 1e-9
    max_iterations: int = 300
    accuracy: float = 1e-2
    verbose: bool = False
    time_limit: float | None = None
    feasibility_restoration: bool = True

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        CollocationPoints.of(self.points, self.degree)
        if self.mesh is None:
            check_intervals(self.intervals, "mesh: intervals")
        else:
            check_instance(self.mesh, Mesh, "collocation: mesh")
        check_positive(self.accuracy, "collocation: accuracy", finite=False)
        check_flag(self.feasibility_restoration, "collocation: feasibility_restoration")
        self.nlp_backend.check()

    def mesh_of(self, ocp: OCP) -> Mesh:
        """Return the mesh for a problem, given or as equal as the knots of its signals allow."""
        if self.mesh:
            return self.mesh
        edges = self.nodes(ocp, self.intervals)
        return Mesh(tuple(edges), (self.degree,) * (len(edges) - 1))

    @property
    def nlp_backend(self) -> NlpBackend:
        """The backend with its options."""
        return NlpBackend(
            tolerance=self.tolerance,
            max_iterations=self.max_iterations,
            verbose=self.verbose,
            time_limit=np.inf if self.time_limit is None else self.time_limit,
        )

    @property
    def success_accuracy(self) -> float:
        """The accepted relative error of a success."""
        return self.accuracy

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "Collocation":
        """Set what is left open; see ``Solver``."""
        limit = time_limit if self.time_limit is None else self.time_limit
        return replace(self, time_limit=limit, judged=False, feasibility_restoration=False)

    def smooth_form(self, ocp: OCP) -> Epigraph | None:
        """Replace every kink: slacks and maxima meet at the collocation points."""
        return epigraph(ocp)

    def build_form(self, form: NormalForm) -> Program:
        """Take algebraic variables as controls: their equations hold at the points."""
        variables = AlgebraicControls(form.implicit)
        if not variables.is_needed:
            return super().build_form(form)
        rewriting = WithSlacks(variables, {"u": variables.first_controls})
        return self.judging(rewriting, self.build_normal(variables.problem))

    def imposed(self, ocp: OCP) -> ImposedRows:
        """Return the rows of the problem, which hold at the points, not at the edges; see above.

        A control jumps at an edge: that of the point there is the one before the jump.
        """
        grid = CollocationGrid.of(self.mesh_of(ocp), self.points)
        edges = np.isin(np.arange(len(grid.nodes)), grid.edge_nodes)
        return ImposedRows(ocp.rows, edges, edges if self.points == "gauss" else None)

    def least_violating(self, ocp: OCP) -> Program | None:
        """Build the problem with a slack for its hard rows; see ``Solver``."""
        return least_violating(self.unjudged(), ocp)

    def prepare(self, ocp: OCP) -> "CollocationProgram":
        """Transcribe the problem and set the backend up.

        Raises:
            UnsupportedProblem: for a discrete-time model, which has nothing to collocate.
        """
        check_instance(ocp, OCP, "collocation: the problem")
        if ocp.model.is_discrete:
            raise UnsupportedProblem(
                f"{ocp.name}: collocation takes no discrete-time model ('{ocp.model.name}')"
            )
        grid = CollocationGrid.of(self.mesh_of(ocp), self.points)
        transcription = CollocatedProblem(ocp, grid)
        nlp = self.nlp_backend.build(transcription)
        return CollocationProgram(self, ocp, transcription, Defects.of(ocp, grid), nlp)


@dataclass(frozen=True, eq=False)
class CollocationProgram(MethodProgram):
    """A collocated problem with its backend.

    Attributes:
        transcription: the problem on its points.
        defects: the dynamics between the nodes.
        nlp: the backend, set up.
    """

    solver: Collocation
    transcription: CollocatedProblem
    defects: Defects
    nlp: Nlp

    def _solve(self, data: RunData, guess: InitialGuess | None) -> RunResult:
        """Solve for these data, in the phases of ``NlpRun``."""
        ocp, duration = self.ocp, first_duration(self.ocp, guess)

        def first(duration: float, source: FirstStates) -> np.ndarray:
            return self._first_iterate(data, guess, duration, source).joined()

        others = partial(other_starts, ocp, guess, duration, first)
        outcome = self._nlp_run.solve(first(duration, "tame"), data, others)
        return self._result(data, outcome)

    @cached_property
    def _nlp_run(self) -> NlpRun:
        """Kept, since it keeps the elastic problem of the feasibility restoration."""
        return NlpRun(
            transcription=self.transcription,
            nlp=self.nlp,
            accuracy=self.solver.accuracy,
            state_error=weak_method(self._state_error),
            feasibility_restoration=self.solver.feasibility_restoration,
        )

    # -- the first iterate -------------------------------------------------------------------

    def _first_iterate(
        self,
        data: RunData,
        guess: InitialGuess | None,
        duration: float | None = None,
        source: FirstStates = "tame",
    ) -> CollocationUnknowns:
        """States and controls of the guess; without states, see ``first_states``."""
        grid, ocp = self.transcription.grid, self.transcription.ocp
        m = ocp.model
        at_points = guess.sample("u", grid.at, m.nu) if guess else None
        u = np.zeros((len(grid.at), m.nu)) if at_points is None else at_points
        c = ocp.control_bounds.clip(self._coefficients(u))
        x = guess.sample("x", grid.nodes, m.nx) if guess else None
        length = duration or first_duration(ocp, guess)

        def rollout() -> np.ndarray:
            return self.defects.rollout(self._elevated(c), length, data)

        if x is None:
            x = first_states(data.x0, len(grid.nodes), ocp.state_bounds, rollout, source)
        z = x[grid.edge_nodes].T
        if ocp.has_free_time:
            time = np.full((1, z.shape[1]), length / self.transcription.time_unit)
            z = np.vstack([z, time])
        return CollocationUnknowns(z, c.T, x[grid.point_nodes].T)

    def _coefficients(self, u: np.ndarray) -> np.ndarray:
        """Bernstein coefficients of controls at the points, (M, nu) both."""
        grid = self.transcription.grid
        return np.vstack(
            [np.linalg.solve(p.B, u[grid.owner == k]) for k, p in enumerate(grid.points)]
        )

    def _elevated(self, c: np.ndarray) -> np.ndarray:
        """Coefficients (M, nu) of any degrees as those of the highest one, interval by interval."""
        grid = self.transcription.grid
        most = max(grid.mesh.degrees)
        parts = [elevated(c[grid.owner == k], most) for k in range(grid.mesh.intervals)]
        return np.vstack(parts)

    # -- the result --------------------------------------------------------------------------

    def _state_error(self, result: NlpResult, data: RunData) -> tuple[float, int]:
        """By how much the integrated dynamics miss a node, relative to 1 + abs(x), and which."""
        w, tr = result.w, self.transcription
        u = self._elevated(tr.split(w).c.T)
        moved, _ = self.defects.relative(self._states(w), u, tr.duration(w), data)
        if not np.max(moved) <= self.solver.accuracy:  # or the explicit steps are too long for it
            moved = self._implicit_error(result, data)
        worst = int(moved.argmax())
        return float(moved[worst]), worst + 1

    def _implicit_error(self, result: NlpResult, data: RunData) -> np.ndarray:
        """The same by the referee's integrators, which treat stiff dynamics as well, (N,)."""
        x, tr = self._states(result.w), self.transcription
        solution = Solution(
            problem=tr.ocp,
            solver="",
            status=Status.SOLVED,
            t=data.t0 + tr.grid.nodes * tr.duration(result.w),
            x=x,
            x0=data.x0,
            costate=np.zeros_like(x),
            u=self._elevated(tr.split(result.w).c.T),
            control_kind="polynomial",
            breaks=tr.grid.edge_nodes,
            cost=result.cost,
            parameters=data.values.as_dict(),
        )
        return (segment_gaps(solution) / (1.0 + np.abs(x).max(axis=0))).max(axis=1)

    def _states(self, w: np.ndarray) -> np.ndarray:
        """States at all nodes, (N + 1, nx)."""
        tr, grid = self.transcription, self.transcription.grid
        parts, nx = tr.split(w), tr.ocp.model.nx
        x = np.empty((len(grid.nodes), nx))
        x[grid.edge_nodes] = parts.z[:nx].T
        x[grid.point_nodes] = parts.x.T  # within the state bounds, at the edges as well
        return x

    def _result(self, data: RunData, outcome: NlpOutcome) -> RunResult:
        """The last result, with the work of all runs."""
        tr, result = self.transcription, outcome.last
        return RunResult(
            status=outcome.status,
            message=outcome.message,
            t=self._nlp_run.times(result, data),
            x=self._states(result.w),
            costate=costates(tr, result, data),
            u=self._elevated(tr.split(result.w).c.T),
            control_kind="polynomial",
            breaks=tr.grid.edge_nodes,
            cost=result.cost,
            residual=outcome.residual,
            iterations=outcome.iterations,
            work=outcome.work,
            history=outcome.history(),
        )
