"""ssqp: SQP along the stages with HPIPM or its own ADMM within, on compiled stages.

It takes dynamics, costs and constraints as Python classes, a stage each; its convexification is
left to who writes them: with a projected Hessian the negative curvature of the cost is taken
away stage by stage, and that of the dynamics left out.
"""

from importlib.metadata import version

import numpy as np
import ssqpy
from c_stage import Compiled, compiled
from slopes import projected
from ssqpy.model.constraints import StageConstraints
from ssqpy.model.costs import StageCost
from ssqpy.model.dynamics import StageDynamics
from wire import bounds_along, serve

_ITERATIONS = {"HPIPM": 300, "ADMM": 100}


class _Stage:
    """What a stage evaluates, remembered as long as nobody asks at another point."""

    def __init__(self, functions: dict[str, Compiled], job: dict, is_end: bool) -> None:
        self._functions, self._nx, self.p = functions, job["nx"], np.zeros(job["np"])
        self.nu = 0 if is_end else job["nu"]
        self.has_projection = "projected" in job["setting"]
        self._prefix = "terminal" if is_end else "stage"
        self._last: dict[str, tuple] = {}

    def move(self, p: np.ndarray) -> None:
        """Take other parameters."""
        self.p, self._last = p, {}

    def values(self, x: np.ndarray, u: np.ndarray) -> list[np.ndarray]:
        """State after it and cost; at the end the cost alone."""
        return self._remembered(self._prefix, x, u)

    def slopes(self, x: np.ndarray, u: np.ndarray) -> list[np.ndarray]:
        """Jacobians of the state after it, then gradient and Hessian of the cost, by x and u."""
        return self._remembered(f"{self._prefix}_slopes", x, u)

    def bend(self, x: np.ndarray, u: np.ndarray, weights: np.ndarray) -> list[np.ndarray]:
        """Second derivatives of the weighted state after it: by xx, xu, uu."""
        if self.has_projection or not self.nu:
            return self._blocks(np.zeros(2 * [self._nx + self.nu]))
        return self._remembered("stage_bend", x, u, weights)

    def _remembered(self, name: str, x: np.ndarray, u: np.ndarray, *more: np.ndarray) -> list:
        key = b"".join(array.tobytes() for array in (x, u, *more))
        known = self._last.get(name)
        if known is None or known[0] != key:
            given = (x, u, self.p, *more) if self.nu else (x, self.p)
            found = [np.array(block) for block in self._functions[name](*given)]
            if name == "terminal_slopes":
                found = [None, None, found[0], np.zeros((0, 1)), *self._convex(found[1])]
            elif name == "stage_slopes":
                whole = np.block([[found[4], found[5]], [found[5].T, found[6]]])
                found[4:] = self._convex(whole)
            known = self._last[name] = (key, found)
        return known[1]

    def _convex(self, whole: np.ndarray) -> list[np.ndarray]:
        return self._blocks(projected(whole) if self.has_projection else whole)

    def _blocks(self, whole: np.ndarray) -> list[np.ndarray]:
        n = self._nx
        return [np.asfortranarray(b) for b in (whole[:n, :n], whole[:n, n:], whole[n:, n:])]


class _Dynamics(StageDynamics):
    def __init__(self, stage: _Stage, nx: int) -> None:
        super().__init__()
        self._stage, self._nx = stage, nx

    def output_size(self):
        return self._nx

    def state_size(self):
        return self._nx

    def state_diff_size(self):
        return self._nx

    def control_size(self):
        return self._stage.nu

    def evaluate(self, x, u):
        return self._stage.values(x, u)[0][:, 0]

    def gradient(self, x, u):
        return tuple(self._stage.slopes(x, u)[:2])

    def hessprod_xx(self, x, u, lam):
        return self._stage.bend(x, u, lam)[0]

    def hessprod_xu(self, x, u, lam):
        return self._stage.bend(x, u, lam)[1]

    def hessprod_uu(self, x, u, lam):
        return self._stage.bend(x, u, lam)[2]


class _Cost(StageCost):
    def __init__(self, stage: _Stage) -> None:
        super().__init__()
        self._stage = stage

    def evaluate(self, x, u):
        return float(self._stage.values(x, u)[-1][0, 0])

    def gradient(self, x, u):
        return tuple(slope[:, 0] for slope in self._stage.slopes(x, u)[2:4])

    def hessian_xx(self, x, u):
        return self._stage.slopes(x, u)[4]

    def hessian_xu(self, x, u):
        return self._stage.slopes(x, u)[5]

    def hessian_uu(self, x, u):
        return self._stage.slopes(x, u)[6]


class _Bounds(StageConstraints):
    """Those states and controls of a stage that are bounded."""

    def __init__(self, nx: int, lower: np.ndarray, upper: np.ndarray) -> None:
        super().__init__()
        rows = np.flatnonzero(np.isfinite(lower) | np.isfinite(upper))
        self._lower, self._upper = lower[rows], upper[rows]
        chosen = np.eye(len(lower))[rows]
        self._on_x, self._on_u = (np.asfortranarray(c) for c in np.split(chosen, [nx], axis=1))

    def output_size(self):
        return len(self._lower)

    def constraint_diff_size(self):
        return len(self._lower)

    def lower_bound(self):
        return self._lower

    def upper_bound(self):
        return self._upper

    def evaluate(self, x, u):
        return self._on_x @ x + self._on_u @ u

    def gradient(self, x, u):
        return self._on_x, self._on_u

    def hessprod_xx(self, x, u, mu):
        return np.zeros((len(x), len(x)), order="F")

    def hessprod_xu(self, x, u, mu):
        return np.zeros((len(x), len(u)), order="F")

    def hessprod_uu(self, x, u, mu):
        return np.zeros((len(u), len(u)), order="F")


class StagewiseQuadratic:
    """Its solver, started anew from the last answer: it keeps no multipliers between solves."""

    def __init__(self, job: dict) -> None:
        """Compile the stages and state the problem."""
        self.versions = {name: version(name) for name in ("ssqp", "numpy")}
        self.remark = "stages are Python classes around machine code"
        if "projected" in job["setting"]:
            self.remark += "; Hessian of the cost projected, no curvature of the dynamics"
        ssqpy.setSilentMode()
        functions, self._n = compiled(job["c"]), job["N"]
        self._stages = [_Stage(functions, job, k == self._n) for k in range(self._n + 1)]
        self._model = ssqpy.model.Model(self._n, job["interval"])
        # It does not keep what it is given alive.
        costs = [_Cost(stage) for stage in self._stages]
        dynamics = [_Dynamics(stage, job["nx"]) for stage in self._stages]
        bounds = [_Bounds(job["nx"], *limits) for limits in bounds_along(job)]
        self._kept = (costs, dynamics, bounds)
        for k, cost in enumerate(costs):
            self._model.addCost(k, cost)
        is_bounded = any(b.output_size() for b in bounds)
        self._model.finalize(dynamics=dynamics, **({"constraints": bounds} if is_bounded else {}))
        self._parameters = _parameters(job)

    def step(self, x0: np.ndarray, p: np.ndarray, guess: dict | None) -> None:
        """Solve from the guess, or from the last answer."""
        x, u = (guess["x"], guess["u"]) if guess else (self._x, self._u)
        for k, stage in enumerate(self._stages):
            stage.move(p[k])
            self._model.setInitState(k, x[k] if k else x0)
        for k in range(self._n):
            self._model.setInitControl(k, u[k])
        self._solver = ssqpy.solvers.ssqp(self._model, self._parameters)
        self._state, states, controls = self._solver.solve()
        self._x = [np.array(states.stage(k)) for k in range(self._n + 1)]
        self._u = [np.array(controls.stage(k)) for k in range(self._n)]

    def plan(self) -> dict:
        """Return the last answer."""
        word = "solved" if self._state is ssqpy.solvers.SolverState.Success else "failed"
        said = f"{word}: {self._state.name}, {self._solver.getConvergenceData().iterations}"
        return {"x": self._x, "u": self._u, "status": f"{said} iterations"}


def _parameters(job: dict) -> ssqpy.solvers.ssqpParams:
    asked = ssqpy.solvers.ssqpParams()
    backend = job["setting"].split(",")[0]
    asked.tolerance, asked.max_iter = job["tolerance"], _ITERATIONS[backend]
    asked.qp_solver_type = getattr(ssqpy.solvers.QPSolverType, backend)
    within = asked.admmParams
    # With no more than the tolerance itself, its iterations stop short of it without an end.
    within.abs_tolerance = within.rel_tolerance = 0.1 * job["tolerance"]
    asked.admmParams = within
    return asked


if __name__ == "__main__":
    serve(StagewiseQuadratic)
