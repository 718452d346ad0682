"""crocoddyl: differential dynamic programming, boxes around the controls, on compiled stages."""

from importlib.metadata import version

import crocoddyl
import numpy as np
from c_stage import compiled
from wire import CannotTreat, refuse_bounds_of_states, serve

_ITERATIONS = 300


class _Node(crocoddyl.ActionModelAbstract):
    """A stage, or the end: exact first derivatives, exact Hessian of the cost."""

    def __init__(self, job: dict, functions: dict, is_end: bool) -> None:
        state = crocoddyl.StateVector(job["nx"])
        crocoddyl.ActionModelAbstract.__init__(self, state, 0 if is_end else job["nu"], 0)
        self._functions, self._is_end, self.p = functions, is_end, np.zeros(job["np"])
        if not is_end:
            self.u_lb, self.u_ub = np.array(job["u_lower"]), np.array(job["u_upper"])

    def calc(self, data, x, u=None):
        if self._is_end or u is None:
            data.cost = float(self._functions["terminal"](x, self.p)[0][0, 0])
            data.xnext = x
        else:
            after, cost = self._functions["stage"](x, u, self.p)
            data.xnext, data.cost = after[:, 0].copy(), float(cost[0, 0])

    def calcDiff(self, data, x, u=None):
        if self._is_end or u is None:
            slope, curvature = self._functions["terminal_slopes"](x, self.p)
            data.Lx, data.Lxx = slope[:, 0].copy(), curvature.copy()
        else:
            found = self._functions["stage_slopes"](x, u, self.p)
            data.Fx, data.Fu = found[0].copy(), found[1].copy()
            data.Lx, data.Lu = found[2][:, 0].copy(), found[3][:, 0].copy()
            data.Lxx, data.Lxu, data.Luu = (block.copy() for block in found[4:])


class BoxedProgramming:
    """``SolverBoxFDDP`` where controls are bounded, else ``SolverFDDP``."""

    def __init__(self, job: dict) -> None:
        """Compile the stages and lay the horizon out."""
        refuse_bounds_of_states(job)
        if job["x_end"]:
            raise CannotTreat("it has no prescribed end but by a penalty")
        self.versions = {
            name: version(name) for name in ("crocoddyl", "pin", "libpinocchio", "numpy")
        }
        self.remark = "stages are Python classes around machine code; no curvature of the dynamics"
        functions = compiled(job["c"])
        self._nodes = [_Node(job, functions, False) for _ in range(job["N"])]
        self._end = _Node(job, functions, True)
        self._problem = crocoddyl.ShootingProblem(np.zeros(job["nx"]), self._nodes, self._end)
        boxed = np.isfinite([*job["u_lower"], *job["u_upper"]]).any()
        solver = crocoddyl.SolverBoxFDDP if boxed else crocoddyl.SolverFDDP
        self._solver = solver(self._problem)
        self._solver.th_stop = job["tolerance"]

    def step(self, x0: np.ndarray, p: np.ndarray, guess: dict | None) -> None:
        """Solve from the guess, or from the last answer."""
        for node, now in zip((*self._nodes, self._end), p, strict=True):
            node.p = now
        self._problem.x0 = x0
        if guess is not None:
            x, u = list(guess["x"]), list(guess["u"])
        else:
            x, u = list(self._solver.xs), list(self._solver.us)
        x[0] = x0
        self._solved = self._solver.solve(x, u, _ITERATIONS, False)

    def plan(self) -> dict:
        """Return the last answer."""
        word = "solved" if self._solved else "failed"
        status = f"{word}, {self._solver.iter} iterations"
        return {"x": list(self._solver.xs), "u": list(self._solver.us), "status": status}


if __name__ == "__main__":
    serve(BoxedProgramming)
