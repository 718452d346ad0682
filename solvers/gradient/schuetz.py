"""Schuetz' method: gradient descent on the controls (Algorithm 2), and a sound version."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp import (
    OCP,
    RK4,
    Buffered,
    Data,
    Euler,
    Integrator,
    ProblemError,
    Program,
    Solution,
    Solver,
    Stage,
    Start,
    Status,
    UnsupportedProblem,
    Work,
    compiled,
    hamiltonian,
    instance,
    whole,
)
from solvers.gradient.line_search import Armijo, FixedStep, StepRule, Trial

# A new gradient less orthogonal to the last one than this has lost conjugacy [Powell 1977].
_POWELL = 0.2


@dataclass(frozen=True)
class Schuetz(Solver):
    """Minimise over the control trajectory by (conjugate) gradients of the Hamiltonian.

    The defaults are Algorithm 2 as the thesis has it: Euler steps, a fixed step, Fletcher-
    Reeves, the costate integrated on its own, and three termination tests. ``sound()`` is
    the same idea with what it needs to converge. Takes control bounds (by projection);
    refuses state, path and terminal constraints and a free final time or start.
    Source: thesis 3.2.5, [Schuetz et al. 2014], [Lasdon, Mitter & Waren 1967].

    Args:
        intervals: held controls; a discrete-time problem brings its own number.
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
    """

    intervals: int = 75
    integrator: Integrator = field(default_factory=Euler)
    step: StepRule = field(default_factory=FixedStep)
    direction: Literal["steepest", "fletcher-reeves", "polak-ribiere"] = "fletcher-reeves"
    gradient: Literal["continuous", "discrete"] = "continuous"
    max_iterations: int = 200
    decrease: float = 1e-4
    stop_on_rise: bool = True
    stationarity: float = 1e-5
    compiled: bool = False

    def __post_init__(self) -> None:
        """Check the options."""
        whole(self.intervals, "Schuetz: intervals")
        whole(self.max_iterations, "Schuetz: max_iterations")
        instance(self.integrator, Integrator, "Schuetz: integrator")
        instance(self.step, (FixedStep, Armijo), "Schuetz: step")
        if self.decrease < 0.0 or self.stationarity < 0.0:
            raise ProblemError("Schuetz: decrease and stationarity must not be negative")
        if self.direction not in ("steepest", "fletcher-reeves", "polak-ribiere"):
            raise ProblemError(f"direction = {self.direction!r} is not known")
        if self.gradient not in ("continuous", "discrete"):
            raise ProblemError(f"gradient = {self.gradient!r} is neither continuous nor discrete")

    @classmethod
    def sound(cls, *, intervals: int = 75, max_iterations: int = 500) -> "Schuetz":
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

    def build(self, ocp: OCP) -> "SchuetzProgram":
        """Build roll-out and costate sweep."""
        _refuse_constraints(ocp)
        if self.gradient == "continuous" and ocp.model.is_discrete:
            raise UnsupportedProblem(
                f"{ocp.name}: the model is discrete in time; use gradient='discrete'"
            )
        n = ocp.steps or self.intervals
        stage = Stage.of(ocp, self.integrator, held=True)
        sweep = (
            stage.adjoint if self.gradient == "discrete" else _costate_step(ocp, self.integrator)
        )
        step = stage.step
        if self.compiled:
            step, sweep = compiled(step), compiled(sweep)
        parts = (step.mapaccum(n), sweep.mapaccum(n))
        ends = (ocp.functions.terminal_cost, ocp.functions.terminal_gradient)
        return SchuetzProgram(self, ocp, n, *map(Buffered, (*parts, *ends)))


def _refuse_constraints(ocp: OCP) -> None:
    for c in ocp.constraints:
        raise UnsupportedProblem(f"{ocp.name}: Schuetz takes no {c.at} constraint ('{c.name}')")
    if ocp.state_bounds.is_active:
        raise UnsupportedProblem(f"{ocp.name}: Schuetz takes no state bounds")
    if ocp.has_free_time:
        raise UnsupportedProblem(f"{ocp.name}: Schuetz takes no free final time")


def _costate_step(ocp: OCP, integrator: Integrator) -> ca.Function:
    """One backward step of (3.62), the state interpolated between its nodes, and H_u there."""
    h, m, n_p = hamiltonian(ocp), ocp.model, ocp.p.numel()
    sizes = {
        "costate": m.nx,
        "x": m.nx,
        "x_next": m.nx,
        "u": m.nu,
        "t": 1,
        "h": 1,
        "p0": n_p,
        "p1": n_p,
    }
    s = {name: ca.SX.sym(name, size) for name, size in sizes.items()}

    def rate(costate: ca.SX, back: ca.SX | float) -> ca.SX:
        """d(costate) over the fraction of the interval, counted from its end."""
        x = s["x_next"] + back * (s["x"] - s["x_next"])
        p = s["p1"] + back * (s["p0"] - s["p1"])
        t = s["t"] + (1.0 - back) * s["h"]
        return -s["h"] * h.costate_rate(x, s["u"], costate, t, p)

    before = integrator(rate, s["costate"], 0.0, 1.0)
    slope = h.control_gradient(s["x"], s["u"], before, s["t"], s["p0"])
    return ca.Function("costate_step", list(s.values()), [before, s["h"] * slope])


@dataclass(frozen=True, eq=False)
class _Iterate:
    """Controls with their trajectory, costates and gradient (per second of an interval)."""

    trial: Trial
    costate: np.ndarray
    gradient: np.ndarray


@dataclass(frozen=True, eq=False)
class SchuetzProgram(Program):
    """Roll-out and costate sweep of a problem."""

    solver: Schuetz
    ocp: OCP
    n: int
    rollout: Buffered
    sweep: Buffered
    final_cost: Buffered
    final_gradient: Buffered

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: Start | None = None,
    ) -> Solution:
        """Descend from the guessed controls, zero unless given."""
        started = perf_counter()
        data = Data.of(self.ocp, x0, t0, parameters)
        descent = _Descent(self, data, guess or self.ocp.guess)
        with np.errstate(over="ignore", invalid="ignore"):  # a descent may climb to overflow
            status = descent.descend()
        best = descent.here if status is Status.STATIONARY else descent.best
        return Solution(
            problem=self.ocp,
            solver=repr(self.solver),
            status=status,
            message=descent.message,
            t=t0 + np.linspace(0.0, 1.0, self.n + 1) * self.ocp.duration,
            x=best.trial.x,
            x0=data.x0,
            costate=best.costate,
            u=best.trial.u,
            cost=best.trial.cost,
            residual=descent.residual(best),
            iterations=len(descent.costs) - 1,
            work=Work(rollouts=descent.rollouts, jacobians=descent.sweeps),
            history={"cost": np.array(descent.costs), "residual": np.array(descent.residuals)},
            parameters=data.values.as_dict(),
            solve_time=perf_counter() - started,
        )


class _Descent:
    """The state of one run of Algorithm 2."""

    def __init__(self, program: SchuetzProgram, data: Data, guess: Start | None) -> None:
        self.program, self.data, self.solver = program, data, program.solver
        self.box = program.ocp.control_bounds
        n, m = program.n, program.ocp.model
        nodes = np.linspace(0.0, 1.0, n + 1)
        left, right = data.values.on(nodes)
        # The weight of a gradient in time: thesis' (g, g) is an integral.
        self.h = 1.0 if m.is_discrete else program.ocp.duration / n
        t = data.t0 + nodes[None, :-1] * program.ocp.duration
        self.schedule = [t, np.full((1, n), self.h), left.T, right.T]
        self.p_final = data.values.at(1.0)[0]
        self.rollouts = self.sweeps = 0
        self.message = ""
        u = guess.sample("u", nodes[:-1], m.nu) if guess else None
        self.here = self._completed(self._trial(np.zeros((n, m.nu)) if u is None else u))
        self.best = self.here
        self.costs = [self.here.trial.cost]
        self.residuals = [self.residual(self.here)]

    # -- Algorithm 2 -----------------------------------------------------------------------

    def descend(self) -> Status:
        """Iterate until a termination test holds."""
        if not np.isfinite(self.here.trial.cost):
            self.message = "the first controls make the state blow up"
            return Status.DIVERGED
        direction, last_gradient, step = None, None, None
        for _ in range(self.solver.max_iterations):
            if self.residuals[-1] <= self.solver.stationarity:
                return Status.STATIONARY
            gradient = self._free_gradient(self.here)
            direction = self._direction(gradient, last_gradient, direction)
            slope = self._inner(gradient, direction)
            accepted = self._advance(direction, slope, step)
            if accepted is None:
                self.message = f"projected gradient {self.residuals[-1]:.3g}"
                return Status.NO_PROGRESS
            trial, step_taken = accepted
            # The next first step is the one that promises the same decrease.
            step = (step_taken, slope)
            last_gradient = gradient
            stop = self._move(trial)
            if stop is not None:
                return stop
        return (
            Status.ITERATION_LIMIT
            if self.residuals[-1] > self.solver.stationarity
            else Status.STATIONARY
        )

    def _move(self, trial: Trial) -> Status | None:
        """Take the trial as the iterate; return the status if a termination test holds."""
        before = self.here.trial.cost
        here = self._completed(trial)
        residual = self.residual(here)
        if not np.isfinite([trial.cost, residual]).all():
            self.message = f"after {len(self.costs)} iterations the state or its costate blows up"
            return Status.DIVERGED
        self.here = here
        self.costs.append(trial.cost)
        self.residuals.append(residual)
        if trial.cost < self.best.trial.cost:
            self.best = self.here
        if trial.cost > before:
            return Status.COST_ROSE if self.solver.stop_on_rise else None
        if before - trial.cost < self.solver.decrease * abs(before):
            return Status.SMALL_DECREASE
        return None

    def _advance(
        self, direction: np.ndarray, slope: float, last: tuple[float, float] | None
    ) -> tuple[Trial, float] | None:
        largest = float(np.abs(direction).max())
        first = (
            last[0] * last[1] / slope
            if last
            else 0.1 * (1.0 + np.abs(self.here.trial.u).max()) / largest
        )
        u = self.here.trial.u
        return self.solver.step.advance(
            lambda step: self._trial(u + step * direction), self.here.trial.cost, slope, first
        )

    def _direction(
        self, gradient: np.ndarray, last: np.ndarray | None, direction: np.ndarray | None
    ) -> np.ndarray:
        if direction is None or last is None or self.solver.direction == "steepest":
            return -gradient
        norm, norm_last = self._inner(gradient, gradient), self._inner(last, last)
        if self.solver.direction == "fletcher-reeves":
            return -gradient + norm / norm_last * direction
        mixed = self._inner(gradient, last)
        if abs(mixed) > _POWELL * norm:
            return -gradient
        candidate = -gradient + max(0.0, (norm - mixed) / norm_last) * direction
        return candidate if self._inner(gradient, candidate) < 0.0 else -gradient

    # -- pieces ----------------------------------------------------------------------------

    def _trial(self, u: np.ndarray) -> Trial:
        u = self.box.clip(u)
        x, costs = self.program.rollout(self.data.x0, u.T, *self.schedule)
        self.rollouts += 1
        x = np.vstack([self.data.x0, x.T])
        t = self.data.t0 + self.program.ocp.duration
        final = self.program.final_cost(x[-1], t, self.p_final)[0]
        cost = float(np.sum(costs) + final.item())
        return Trial(u, x, cost if np.isfinite(cost) and np.isfinite(x).all() else np.inf)

    def _completed(self, trial: Trial) -> _Iterate:
        """Return the trial with its costates and gradient; at rest where it blows up."""
        if not np.isfinite(trial.cost):
            still = np.tile(self.data.x0, (len(trial.x), 1))
            return _Iterate(
                Trial(trial.u, still, np.inf), np.zeros_like(still), np.zeros_like(trial.u)
            )
        final = self._final_costate(trial.x[-1])
        states = [trial.x[:-1].T, trial.u.T]
        if self.solver.gradient == "continuous":
            states.insert(1, trial.x[1:].T)
        backwards = [a[:, ::-1] for a in (*states, *self.schedule)]
        costate, gradient = self.program.sweep(final, *backwards)
        self.sweeps += 1
        costates = np.vstack([costate.T[::-1], final])
        return _Iterate(trial, costates, gradient.T[::-1] / self.h)

    def _final_costate(self, x: np.ndarray) -> np.ndarray:
        t = self.data.t0 + self.program.ocp.duration
        return self.program.final_gradient(x, t, self.p_final)[0].ravel()

    def _free_gradient(self, iterate: _Iterate) -> np.ndarray:
        """The gradient, without components that would only push into a bound."""
        u, g = iterate.trial.u, iterate.gradient
        blocked = ((u <= np.asarray(self.box.lower)) & (g > 0.0)) | (
            (u >= np.asarray(self.box.upper)) & (g < 0.0)
        )
        return np.where(blocked, 0.0, g)

    def residual(self, iterate: _Iterate) -> float:
        """Return the largest projected gradient."""
        return float(np.abs(self._free_gradient(iterate)).max(initial=0.0))

    def _inner(self, a: np.ndarray, b: np.ndarray) -> float:
        return self.h * float(np.vdot(a, b))
