"""Schuetz' method: gradient descent on the controls (Algorithm 2), and a sound version."""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, NamedTuple, get_args

import numpy as np

from ocp import (
    OCP,
    RK4,
    Euler,
    Grid,
    InitialGuess,
    Integrator,
    Program,
    Status,
    UnsupportedProblem,
    Work,
)
from ocp.internal import (
    BlockingSolver,
    MethodProgram,
    RunData,
    RunResult,
    check_choice,
    check_flag,
    check_instance,
    check_intervals,
    check_not_negative,
    check_whole,
    node_fractions,
    refuse_compiled,
    refuse_free_ends,
    refuse_state_bounds,
)
from solvers.gradient.cost_gradient import AdjointSweeps, ControlIterate, Objective
from solvers.gradient.descent_direction import DescentStep, DirectionRule, search_direction
from solvers.gradient.line_search import AcceptedStep, Armijo, FixedStep, StepRule


@dataclass(frozen=True)
class Schuetz(BlockingSolver):
    """Minimise over the control trajectory by (conjugate) gradients of the Hamiltonian.

    The defaults are Algorithm 2 as the thesis has it: Euler steps, a fixed step, Fletcher-
    Reeves, the costate integrated on its own, and three termination tests. ``sound()`` is
    the same idea with what it needs to converge. Takes control bounds (by projection);
    refuses state, path and terminal constraints and a free final time or start.
    Source: thesis 3.2.5, [Schuetz et al. 2014], [Lasdon, Mitter & Waren 1967].

    Args:
        intervals: held controls; a discrete-time problem brings its own number. Or a ``Grid``.
        integrator: one-step method in each interval.
        step: ``FixedStep(alpha)`` or ``Armijo()``.
        direction: ``"steepest"`` (3.65), ``"fletcher-reeves"`` (Algorithm 2) or
            ``"polak-ribiere"`` (never negative, restarted where conjugacy is lost).
        gradient: ``"continuous"``: H_y along a costate integrated backwards (3.62);
            ``"discrete"``: the exact gradient of the discretised cost.
        max_iterations: first termination test, j_max.
        decrease: second test: relative decrease below this, epsilon; 0: off.
        stop_on_rise: third test.
        stationarity: converged when the largest projected gradient falls below this.
        compiled: run the stages as machine code; the first build takes seconds, see ``compiled``.
        blocks: see ``MultipleShooting``.
    """

    derivatives: ClassVar[int] = 1
    intervals: int | Grid = 75
    integrator: Integrator = field(default_factory=Euler)
    step: StepRule = field(default_factory=FixedStep)
    direction: DirectionRule = "fletcher-reeves"
    gradient: Literal["continuous", "discrete"] = "continuous"
    max_iterations: int = 200
    decrease: float = 1e-4
    stop_on_rise: bool = True
    stationarity: float = 1e-5
    compiled: bool = False

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        check_intervals(self.intervals, "Schuetz: intervals")
        check_whole(self.max_iterations, "Schuetz: max_iterations")
        check_instance(self.integrator, Integrator, "Schuetz: integrator")
        check_instance(self.step, (FixedStep, Armijo), "Schuetz: step")
        for name in ("decrease", "stationarity"):
            check_not_negative(getattr(self, name), f"Schuetz: {name}", finite=False)
        check_choice(self.direction, get_args(DirectionRule), "Schuetz: direction")
        check_choice(self.gradient, ("continuous", "discrete"), "Schuetz: gradient")
        check_flag(self.stop_on_rise, "Schuetz: stop_on_rise")
        check_flag(self.compiled, "Schuetz: compiled")

    @classmethod
    def sound(cls, *, intervals: int | Grid = 75, max_iterations: int = 500) -> "Schuetz":
        """Return the version that converges: line search, restarts, exact gradient, RK4."""
        return cls(
            intervals=intervals,
            integrator=RK4(),
            step=Armijo(),
            direction="polak-ribiere",
            gradient="discrete",
            max_iterations=max_iterations,
            decrease=0.0,
        )

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "Schuetz":
        """Set what is left open; see ``Solver``."""
        return replace(self, compiled=compiled or self.compiled, judged=False)

    def build_normal(self, ocp: OCP) -> Program:
        """Build it; a fixed step has units, and is taken in those of the problem as written."""
        fixed = isinstance(self.step, FixedStep)
        return self.prepare(ocp) if fixed else super().build_normal(ocp)

    def prepare(self, ocp: OCP) -> "SchuetzProgram":
        """Build roll-out and costate sweep."""
        check_instance(ocp, OCP, "Schuetz: the problem")
        _refuse_constraints(ocp)
        refuse_compiled(ocp, compiled=self.compiled)
        exact = self.gradient == "discrete"
        nodes = node_fractions(ocp, self.intervals)
        sweeps = AdjointSweeps.of(ocp, nodes, self.integrator, exact=exact, fast=self.compiled)
        sweeps = replace(sweeps, blocks=self.blocks_on(ocp, sweeps.n))
        return SchuetzProgram(self, ocp, sweeps)


def _refuse_constraints(ocp: OCP) -> None:
    for c in ocp.constraints:
        raise UnsupportedProblem(f"{ocp.name}: Schuetz takes no {c.at} constraint ('{c.name}')")
    refuse_state_bounds(ocp, "Schuetz")
    refuse_free_ends(ocp, "Schuetz")


@dataclass(frozen=True, eq=False)
class SchuetzProgram(MethodProgram):
    """Roll-out and costate sweep of a problem.

    Attributes:
        sweeps: both integrations.
    """

    solver: Schuetz
    sweeps: AdjointSweeps

    def _solve(self, data: RunData, guess: InitialGuess | None) -> RunResult:
        """Descend from the guessed controls, zero unless given."""
        ocp, objective = self.ocp, Objective(self.sweeps, data)
        u = guess.sample("u", objective.nodes[:-1], ocp.model.nu) if guess else None
        descent = _Descent(
            self.solver, objective, np.zeros((self.sweeps.n, ocp.model.nu)) if u is None else u
        )
        with np.errstate(over="ignore", invalid="ignore"):  # the cost may rise until it overflows
            found = descent.run()
        shown = found.iterate
        return RunResult(
            status=found.status,
            message=found.message,
            t=data.t0 + objective.nodes * ocp.duration,
            x=shown.trial.x,
            costate=shown.costate,
            u=shown.trial.u,
            cost=shown.trial.cost,
            residual=objective.residual(shown),
            iterations=len(found.costs) - 1,
            work=Work(rollouts=objective.rollouts, jacobians=objective.backward),
            history={"cost": np.array(found.costs), "residual": np.array(found.residuals)},
        )


class _DescentResult(NamedTuple):
    """How a descent ended.

    Attributes:
        status: the termination test that held.
        message: what the status alone does not say.
        iterate: the last one where it is stationary, else the one with the least cost.
        costs: of the iterates.
        residuals: largest projected gradient of each.
    """

    status: Status
    message: str
    iterate: ControlIterate
    costs: list[float]
    residuals: list[float]


class _Descent:
    """Algorithm 2 from some controls: the iterate, the best one so far, and their history."""

    def __init__(self, solver: Schuetz, objective: Objective, u: np.ndarray) -> None:
        self.solver, self.objective = solver, objective
        self.here = self.best = objective.differentiated(objective.rolled_out(u))
        self.costs = [self.here.trial.cost]
        self.residuals = [objective.residual(self.here)]

    def run(self) -> _DescentResult:
        """Iterate until a termination test holds."""
        status, message = self._iterate()
        shown = self.here if status is Status.STATIONARY else self.best
        return _DescentResult(status, message, shown, self.costs, self.residuals)

    def _iterate(self) -> tuple[Status, str]:
        if not self.here.is_finite:
            return Status.DIVERGED, "the first controls make the state or its costate blow up"
        objective, last = self.objective, None
        for _ in range(self.solver.max_iterations):
            if self.is_stationary:
                return Status.STATIONARY, ""
            g = objective.free_gradient(self.here)
            s = search_direction(self.solver.direction, g, last, objective.inner)
            slope = objective.inner(g, s)
            accepted = self._advance(s, slope, self._first_step(s, slope, last))
            if accepted is None:
                return Status.NO_PROGRESS, f"projected gradient {self.residuals[-1]:.3g}"
            here = objective.differentiated(accepted.trial)
            last = DescentStep(g, s, slope, accepted.step)
            if not here.is_finite:
                done = len(self.costs)
                return Status.DIVERGED, f"after {done} iterations the state or its costate blows up"
            self._move_to(here)
            ended = self._termination()
            if ended:
                return ended, ""
        return (Status.STATIONARY if self.is_stationary else Status.ITERATION_LIMIT), ""

    @property
    def is_stationary(self) -> bool:
        """Whether no component of the projected gradient is left."""
        return self.residuals[-1] <= self.solver.stationarity

    def _advance(self, s: np.ndarray, slope: float, first: float) -> AcceptedStep | None:
        """Roll out u + step s, with the step that the rule accepts."""
        u, cost = self.here.trial.u, self.here.trial.cost
        return self.solver.step.advance(
            lambda step: self.objective.rolled_out(u + step * s), cost, slope, first
        )

    def _first_step(self, s: np.ndarray, slope: float, last: DescentStep | None) -> float:
        """The step that promises the decrease of the last one; at first a tenth of the controls."""
        if last is None:
            return 0.1 * (1.0 + np.abs(self.here.trial.u).max()) / float(np.abs(s).max())
        return last.step * last.slope / slope

    def _move_to(self, here: ControlIterate) -> None:
        self.here = here
        self.costs.append(here.trial.cost)
        self.residuals.append(self.objective.residual(here))
        if here.trial.cost < self.best.trial.cost:
            self.best = here

    def _termination(self) -> Status | None:
        """Algorithm 2's tests on the cost: that it rose, that it hardly falls."""
        before, cost = self.costs[-2:]
        if cost > before:
            return Status.COST_ROSE if self.solver.stop_on_rise else None
        if before - cost < self.solver.decrease * abs(before):
            return Status.SMALL_DECREASE
        return None
