"""Dynamic programming on a grid: the global optimum of problems with few states."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ocp import (
    OCP,
    RK4,
    Box,
    InitialGuess,
    Integrator,
    ProblemError,
    Status,
    UnsupportedProblem,
    Work,
)
from ocp.internal import (
    MethodProgram,
    MethodSolver,
    RunData,
    RunResult,
    check_instance,
    check_not_negative,
    check_whole,
    refuse_free_ends,
)
from solvers.tabular.bellman import Bellman, ValueFunction
from solvers.tabular.grid_functions import GridFunctions
from solvers.tabular.policy_run import PolicyRun, follow_policy
from solvers.tabular.state_grid import Axis, StateGrid

Points = int | tuple[int | Axis, ...]
# Bytes that a pair of state and control takes: its cost, its sum and their temporaries ...
_PER_PAIR = 64
# ... and each corner of the cell its next state is in.
_PER_CORNER = 36


@dataclass(frozen=True)
class GridDP(MethodSolver):
    r"""Bellman's recursion 2.22 to 2.33 on a grid, for any problem with one to three states.

    Takes dynamics, costs and path constraints of any kind, state bounds, terminal constraints
    as terminal set, discrete and continuous time (one held control per interval). Whatever
    leaves the grid counts as infeasible: the grid is a state bound. Needs no guess and finds
    the global optimum up to the grid. Multilinear interpolation overestimates a convex value
    function, by an amount that falls with the square of the cell.

    **Error estimate.** Everything is solved again with half the points of states and controls,
    :math:`J_2`, and with a quarter, :math:`J_4`. With :math:`J_1` from the full grid and
    :math:`J` the cost of the trajectory that is returned, ``Solution.residual`` is

    .. math:: \max(J_2 - J_1, \; (J_4 - J_2) / 4, \; J_1 - J) \quad \text{in absolute values}

    Where convergence is of second order, as for smooth value functions, that is three times
    the error, the factor that [Roache 1994] asks for; where it is of first, the error. The
    second term is what the first should be; it guards against grids that agree by chance.
    It is an estimate, no bound. ``Solution.history["value"]`` holds the three.

    **Costates** are differences of neighbouring values of the grid, interpolated.
    Source: thesis 2.1.2, [Bellman 1957].

    Args:
        states: points along each state, or an ``Axis`` for each; a number takes its range
            from the state bounds; a single number holds for all.
        controls: the same for the controls, with the control bounds.
        intervals: number of steps of a continuous model; a discrete one brings its own.
        integrator: one-step method in each interval.
        terminal_slack: by how much terminal constraints may be missed, in their own unit. An
            equation has no interior: no grid meets it without slack.
        accuracy: largest error estimate that is accepted, relative to 1 + abs(cost).
        memory: largest memory that a program may take [bytes].
    """

    derivatives: ClassVar[int] = 1
    states: Points = 101
    controls: Points = 41
    intervals: int = 50
    integrator: Integrator = field(default_factory=RK4)
    terminal_slack: float = 0.0
    accuracy: float = 0.05
    memory: float = 3e9

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        check_whole(self.intervals, "GridDP: intervals")
        check_instance(self.integrator, Integrator, "GridDP: integrator")
        for name in ("terminal_slack", "accuracy", "memory"):
            check_not_negative(getattr(self, name), f"GridDP: {name}", finite=False)

    @property
    def success_accuracy(self) -> float:
        """The accepted relative error of a success."""
        return self.accuracy

    @property
    def end_slack(self) -> float:
        """By how much a terminal constraint may be missed."""
        return self.terminal_slack

    def prepare(self, ocp: OCP) -> "GridDPProgram":
        """Lay the grids and build the functions of a step."""
        check_instance(ocp, OCP, "GridDP: the problem")
        refuse_free_ends(ocp, "GridDP")
        self._refuse_equations(ocp)
        m = ocp.model
        states = _grid(self.states, ocp.state_bounds, m.x_names, "states")
        controls = _grid(self.controls, ocp.control_bounds, m.u_names, "controls")
        self._check_memory(ocp, states, controls)
        n = ocp.steps or self.intervals
        functions = GridFunctions.of(ocp, self.integrator)
        fine = Bellman(ocp, states, controls, n, functions, self.terminal_slack)
        half = replace(fine, grid=states.coarser, controls=controls.coarser)
        quarter = replace(fine, grid=half.grid.coarser, controls=half.controls.coarser)
        return GridDPProgram(self, ocp, (quarter, half, fine))

    def _refuse_equations(self, ocp: OCP) -> None:
        for c in (*ocp.at("path"), *ocp.at("terminal")):
            if not np.any(np.asarray(c.lower) == np.asarray(c.upper)):
                continue
            if c.at == "terminal" and self.terminal_slack:
                continue
            advice = "give GridDP a terminal_slack" if c.at == "terminal" else "eliminate it"
            raise UnsupportedProblem(
                f"{ocp.name}: {c.at} constraint '{c.name}' is an equation, which no grid meets; "
                f"{advice}"
            )

    def _check_memory(self, ocp: OCP, states: StateGrid, controls: StateGrid) -> None:
        pairs, n = states.size * controls.size, ocp.steps or self.intervals
        needed = pairs * (_PER_PAIR + _PER_CORNER * 2.0**ocp.model.nx)
        needed += 8.0 * n * states.size * (1 + ocp.model.nu)
        if needed > self.memory:
            shape = " x ".join(str(p) for p in states.shape)
            raise UnsupportedProblem(
                f"{ocp.name}: {ocp.model.nx} states on a grid of {shape} points with "
                f"{controls.size} controls take {needed / 1e9:.3g} GB, more than memory = "
                f"{self.memory / 1e9:.3g} GB: take fewer points, or a solver that needs no grid"
            )


def _grid(points: Points, box: Box, names: tuple[str, ...], what: str) -> StateGrid:
    """Return the axes, each within its bounds."""
    if not isinstance(points, int | tuple | list):
        raise ProblemError(f"GridDP: {what} = {points!r} is no number of points and no axes")
    given = (points,) * len(names) if isinstance(points, int) else tuple(points)
    if len(given) != len(names):
        raise ProblemError(
            f"GridDP: {what} has {len(given)} entries for {len(names)}: {', '.join(names)}"
        )
    lower, upper = np.asarray(box.lower), np.asarray(box.upper)
    return StateGrid(
        tuple(
            _axis(axis, float(low), float(high), f"GridDP: {what} of '{name}'")
            for axis, low, high, name in zip(given, lower, upper, names, strict=True)
        )
    )


def _axis(axis: int | Axis, lower: float, upper: float, what: str) -> Axis:
    if not isinstance(axis, Axis):
        if not np.isfinite(upper - lower):
            raise ProblemError(
                f"{what}: the problem gives the bounds {lower:g} and {upper:g}; "
                f"say where the grid ends, with Axis(lower, upper, {axis})"
            )
        if lower == upper:
            raise ProblemError(f"{what}: its bounds are both {lower:g}, there is nothing to grid")
        return Axis(lower, upper, axis)
    if axis.lower < lower or axis.upper > upper:
        raise ProblemError(
            f"{what}: from {axis.lower:g} to {axis.upper:g} is outside "
            f"the bounds {lower:g} and {upper:g}"
        )
    return axis


@dataclass(frozen=True, eq=False)
class GridDPProgram(MethodProgram):
    """A problem on its grid; tables are kept as long as time and parameters stay the same.

    Attributes:
        levels: the recursion with a quarter of the points, with half, and with all.
    """

    solver: GridDP
    levels: tuple[Bellman, ...]
    _kept: dict[str, tuple[bytes, tuple[ValueFunction, ...]]] = field(
        default_factory=dict, repr=False
    )

    @property
    def grid(self) -> StateGrid:
        """The points of the states."""
        return self.levels[-1].grid

    def tabulate(
        self, *, t0: float = 0.0, parameters: Mapping[str, ArrayLike] | None = None
    ) -> ValueFunction:
        """Return value function, policy and reachable sets for these data."""
        return self._tables(RunData.of(self.ocp, t0=t0, parameters=parameters))[-1]

    @property
    def _differentiates(self) -> bool:
        """Bellman's recursion compares values."""
        return False

    def _solve(self, data: RunData, guess: InitialGuess | None) -> RunResult:
        """Fill the table, unless it is the last one, and follow its policy; no guess is used."""
        for value, axis, name in zip(data.x0, self.grid.axes, self.ocp.model.x_names, strict=True):
            if not axis.lower <= value <= axis.upper:
                raise ProblemError(
                    f"{self.ocp.name}: x0 ({name}) = {value:g} is outside the grid, "
                    f"[{axis.lower:g}, {axis.upper:g}]"
                )
        before = self._kept.get("tables")
        tables = self._tables(data)
        runs = [follow_policy(b, table, data) for b, table in zip(self.levels, tables, strict=True)]
        run, error = runs[-1], _error(runs)
        status, message = self._verdict(run, error, data)
        work = sum(b.controls.size for b in self.levels)
        if self._kept.get("tables") is not before:
            work += sum(b.pairs for b in self.levels)
        return RunResult(
            status=status,
            message=message,
            t=tables[-1].t,
            x=run.x,
            costate=self._costates(tables[-1], run, data),
            u=run.u,
            cost=run.cost,
            residual=error,
            iterations=1,
            work=Work(rollouts=work),
            history={"value": np.array([r.expected for r in runs])},
        )

    def _tables(self, data: RunData) -> tuple[ValueFunction, ...]:
        key = b"".join([np.float64(data.t0).tobytes(), *[v.tobytes() for v in data.values.values]])
        kept = self._kept.get("tables")
        if kept is None or kept[0] != key:
            kept = (key, tuple(b.table(data) for b in self.levels))
            self._kept["tables"] = kept
        return kept[1]

    def _costates(self, table: ValueFunction, run: PolicyRun, data: RunData) -> np.ndarray:
        """Slopes of the value function along the trajectory; at its end those of the cost."""
        rows = [table.slope(k, x) for k, x in enumerate(run.x[:-1])]
        final = self.ocp.functions.terminal_gradient(run.x[-1], table.t[-1], data.values.at(1.0)[0])
        return np.nan_to_num(np.vstack([*rows, np.array(final).ravel()]), posinf=0.0, neginf=0.0)

    def _verdict(self, run: PolicyRun, error: float, data: RunData) -> tuple[Status, str]:
        if run.failed is not None:
            return Status.INFEASIBLE, self._why(run, data)
        if error > self.solver.accuracy * (1.0 + abs(run.cost)):
            return Status.INACCURATE, (
                f"the grid's error is about {error:.2g} in a cost of {run.cost:.4g}: take more "
                "points of states and controls"
            )
        return Status.SOLVED, ""

    def _why(self, run: PolicyRun, data: RunData) -> str:
        """Name what cannot be met: the terminal set, if all else can."""
        k, ocp = run.failed or 0, self.ocp
        where = f"no control is feasible at step {k}, t = {data.t0 + k * self._h:.4g} s"
        names = [c.name for c in ocp.at("terminal")]
        if names:
            free = replace(self.levels[-1], slack=np.inf)
            if follow_policy(free, free.table(data), data).failed is None:
                return f"{where}: terminal constraint '{', '.join(names)}' is out of reach"
        bounded = [
            name
            for name, axis in zip(ocp.model.x_names, self.grid.axes, strict=True)
            if np.isfinite(axis.step)
        ]
        named = [f"'{c.name}'" for c in ocp.at("path")] + [f"grid of '{n}'" for n in bounded]
        return f"{where}, because of one of: {', '.join(named)}"

    @property
    def _h(self) -> float:
        return self.ocp.duration / self.levels[-1].n


def _error(runs: list[PolicyRun]) -> float:
    """Return the estimate of the class docstring; inf where the half grid has no trajectory."""
    j4, j2, j1 = (r.expected for r in runs)
    if not np.isfinite([j2, j1, runs[-1].cost]).all():
        return np.inf
    parts = [abs(j2 - j1), abs(j1 - runs[-1].cost)]
    if np.isfinite(j4):
        parts.append(abs(j4 - j2) / 4.0)
    return float(max(parts))
