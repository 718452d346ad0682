"""Greedy control: at every step the input that is best for that step alone."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ocp import OCP, RK4, InitialGuess, Integrator, Status, Work
from ocp.internal import (
    QUIET,
    MethodProgram,
    RunData,
    RunResult,
    ScalingSolver,
    Stage,
    check_instance,
    check_positive,
    check_whole,
    refuse_free_ends,
)
from solvers.tabular.greedy_step import OneStep, one_step


@dataclass(frozen=True)
class Greedy(ScalingSolver):
    r"""One step ahead, for any problem with a fixed start and duration.

    .. math::

        u_k = \arg\min_u \; \{ q_k(u, x_{k+1}) \mid u \in U, \;
        x_{k+1} = F_k(x_k, u) \in X \}

    As the thesis has it, the cost of a step is that of the input and of the state it leads
    to, so that the effect of the input is seen:

    .. math::

        q_k = h \, L(x_{k+1}, u, t_{k+1}), \qquad
        q_{N-1} = h \, L(x, u, t) + \varphi(x_N)

    with h = 1 and L at :math:`x_{N-1}` in the last step of a discrete-time problem, and h the
    interval and L at :math:`x_N` in that of a continuous one. Where L is a term in x plus one
    in u, the q of a discrete-time problem add up to its cost less the constant of the start.

    Path constraints with a control hold at x_k, those without and the state bounds at
    x_{k+1}, terminal constraints in the last step. Nothing is planned: a later step may find
    no feasible input, and the inequality 1.4 says what the answer costs. ``MYOPIC`` is the
    status of a run that went through. A step is solved locally, from the last input.
    Source: thesis 1.3, [Waechter & Biegler 2006].

    Args:
        intervals: steps of a continuous model; a discrete one brings its own.
        integrator: one-step method in each interval.
        tolerance: of the optimality conditions of each step.
        max_iterations: limit of each step.
    """

    intervals: int = 75
    integrator: Integrator = field(default_factory=RK4)
    tolerance: float = 1e-9
    max_iterations: int = 100

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        check_whole(self.intervals, "Greedy: intervals")
        check_instance(self.integrator, Integrator, "Greedy: integrator")
        check_whole(self.max_iterations, "Greedy: max_iterations")
        check_positive(self.tolerance, "Greedy: tolerance", below=1.0)

    def prepare(self, ocp: OCP) -> "GreedyProgram":
        """Build the problem of a step, and that of the last step."""
        check_instance(ocp, OCP, "Greedy: the problem")
        refuse_free_ends(ocp, "Greedy")
        stage = Stage.of(ocp, self.integrator, held=True)
        n, options = ocp.steps or self.intervals, _options(self)
        inner, last = (one_step(ocp, stage, options, last=flag) for flag in (False, True))
        return GreedyProgram(self, ocp, n, stage.step, stage.adjoint.mapaccum(n), inner, last)


def _options(solver: Greedy) -> dict[str, Any]:
    return QUIET | {
        # Its only check that the toolkit has not made itself prints a warning.
        "inputs_check": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.tol": solver.tolerance,
        "ipopt.max_iter": solver.max_iterations,
        "ipopt.bound_relax_factor": 0.0,
        # Controls whose bounds are equal stay unknowns: else none may be left.
        "ipopt.fixed_variable_treatment": "make_constraint",
    }


@dataclass(eq=False)
class _Walk:
    """What has been done so far."""

    x: list[np.ndarray]
    u: list[np.ndarray]
    cost: float = 0.0
    iterations: int = 0
    status: Status = Status.MYOPIC
    message: str = ""


@dataclass(frozen=True, eq=False)
class GreedyProgram(MethodProgram):
    """The problem of a step, built once.

    Attributes:
        n: number of steps.
        step: state and cost after one.
        sweep: costates along the whole trajectory.
        inner: the problem of every step but the last.
        last: that of the last.
    """

    solver: Greedy
    n: int
    step: ca.Function
    sweep: ca.Function
    inner: OneStep
    last: OneStep

    def _solve(self, data: RunData, guess: InitialGuess | None) -> RunResult:
        """Go from step to step; of a guess only the first control is used."""
        ocp, n, m = self.ocp, self.n, self.ocp.model
        nodes = np.linspace(0.0, 1.0, n + 1)
        first = guess.sample("u", nodes[:1], m.nu) if guess else None
        u = ocp.control_bounds.clip(np.zeros(m.nu) if first is None else first[0])
        walk = self._walk(data, nodes, u)
        return RunResult(
            status=walk.status,
            message=walk.message,
            t=data.t0 + nodes * ocp.duration,
            x=np.array(walk.x),
            costate=self._costates(walk, data, nodes),
            u=np.array(walk.u),
            cost=walk.cost,
            iterations=walk.iterations,
            work=Work(rollouts=1, jacobians=1, factorisations=walk.iterations),
        )

    def _walk(self, data: RunData, nodes: np.ndarray, u: np.ndarray) -> _Walk:
        """All steps; after one that fails the control is held."""
        ocp, n, walk = self.ocp, self.n, _Walk([data.x0], [])
        left, right = data.values.on(nodes)
        after = np.vstack([left[1:], data.values.at(1.0)])
        t, h = data.t0 + nodes * ocp.duration, ocp.duration / n
        for k in range(n):
            now = [[t[k]], [h], left[k], right[k]]
            if walk.status is Status.MYOPIC:
                here = np.concatenate([walk.x[-1], *now, [t[k + 1]], after[k]])
                u = self._choose(walk, k, u, here, t[k])
            stepped = [np.array(v).ravel() for v in self.step(walk.x[-1], u, *now)]
            x, walk.cost = stepped[0], walk.cost + float(stepped[1][0])
            if not np.isfinite([*x, walk.cost]).all():
                return self._blown_up(walk, u, t[k])
            walk.x.append(x)
            walk.u.append(u)
        walk.cost += float(ocp.functions.terminal_cost(walk.x[-1], t[-1], after[-1]))
        if walk.status is not Status.MYOPIC or not np.isfinite(walk.cost):
            walk.cost = np.inf
        return walk

    def _choose(self, walk: _Walk, k: int, u: np.ndarray, here: np.ndarray, t: float) -> np.ndarray:
        problem = self.last if k == self.n - 1 else self.inner
        found = problem.solve(u, here, self.ocp.control_bounds)
        walk.iterations += found.iterations
        if found.broken or not found.success:
            walk.status = _status(found.broken, found.word)
            why = (
                f"no control keeps {found.broken}"
                if found.broken
                else f"the backend says {found.word}"
            )
            walk.message = f"step {k}, t = {t:.4g} s: {why}; the control is held from there"
        return found.u

    def _blown_up(self, walk: _Walk, u: np.ndarray, t: float) -> _Walk:
        rest = self.n - len(walk.u)
        walk.x += [walk.x[-1]] * rest
        walk.u += [u] * rest
        walk.cost = np.inf
        if walk.status is Status.MYOPIC:
            walk.status, walk.message = Status.DIVERGED, f"the state blows up at t = {t:.4g} s"
        return walk

    def _costates(self, walk: _Walk, data: RunData, nodes: np.ndarray) -> np.ndarray:
        """The derivative of the cost along the controls, held as they are."""
        ocp, x, p = self.ocp, np.array(walk.x), data.values.at(1.0)[0]
        t, (left, right) = data.t0 + nodes * ocp.duration, data.values.on(nodes)
        final = np.array(ocp.functions.terminal_gradient(x[-1], t[-1], p)).ravel()
        h = np.full((1, self.n), ocp.duration / self.n)
        inputs = [x[:-1].T, np.array(walk.u).T, t[None, :-1], h, left.T, right.T]
        costate, _ = self.sweep(final, *[ca.DM(a[:, ::-1]) for a in inputs])
        rows = np.vstack([np.array(costate).T[::-1], final])
        return rows if np.isfinite(rows).all() else np.zeros_like(rows)


def _status(broken: str, word: str) -> Status:
    if broken.startswith("'") or word in _INFEASIBLE:
        return Status.INFEASIBLE
    if word == "Maximum_Iterations_Exceeded":
        return Status.ITERATION_LIMIT
    return Status.DIVERGED if broken or word == "Diverging_Iterates" else Status.FAILED


_INFEASIBLE = ("Infeasible_Problem_Detected", "Not_Enough_Degrees_Of_Freedom")
