"""qpmpc: the problem condensed to a quadratic program, for any backend of qpsolvers.

Its quickest way through a closed loop: the matrices are made once, a step updates the vectors.
"""

import warnings
from importlib.metadata import version

import numpy as np
import qpmpc
import qpsolvers
from wire import CannotTreat, serve

# Backends that know sparse matrices only.
_SPARSE = ("osqp", "clarabel", "highs", "scs")
_PACKAGES = {"proxqp": "proxsuite"}


def _accuracy(tolerance: float) -> dict[str, dict]:
    """What asks each backend for a tolerance; the active set of quadprog is exact by itself."""
    return {
        "osqp": {"eps_abs": tolerance, "eps_rel": 0.0, "max_iter": 100_000},
        "piqp": {"eps_abs": tolerance, "eps_rel": 0.0},
        "proxqp": {"eps_abs": tolerance, "eps_rel": 0.0},
        "daqp": {"primal_tol": tolerance, "dual_tol": tolerance},
        "quadprog": {},
    }


class CondensedTracking:
    """What it states itself constrains nodes 0 to N - 1.

    The measured state is left free here, as everywhere, and node N is constrained through the
    state before it.
    """

    def __init__(self, job: dict) -> None:
        """State the problem."""
        if job["linear"] is None:
            raise CannotTreat("linear dynamics and quadratic costs only")
        self._backend = job["setting"]
        self.versions = {
            name: version(_PACKAGES.get(name, name))
            for name in ("qpmpc", "qpsolvers", self._backend, "numpy")
        }
        self.remark = ""
        self._accuracy = _accuracy(job["tolerance"])[self._backend]
        linear = {name: np.array(value) for name, value in job["linear"].items()}
        self._A, self._B, self._N = linear["A"], linear["B"], job["N"]
        self._problem = qpmpc.MPCProblem(
            transition_state_matrix=self._A,
            transition_input_matrix=self._B,
            **_inequalities(job, self._A, self._B),
            nb_timesteps=job["N"],
            terminal_cost_weight=_scalar(linear["P"], "P"),
            stage_state_cost_weight=_scalar(linear["Q"], "Q"),
            stage_input_cost_weight=_scalar(linear["R"], "R"),
            initial_state=np.zeros(job["nx"]),
            goal_state=np.zeros(job["nx"]),
            target_states=np.zeros(job["nx"] * job["N"]),
        )
        self._program = qpmpc.MPCQP(self._problem, sparse=self._backend in _SPARSE)

    def step(self, x0: np.ndarray, p: np.ndarray, guess: dict | None) -> None:
        """Solve from the guess, or from the last answer."""
        reference = p[:, 1:]
        self._problem.update_initial_state(x0)
        self._problem.update_target_states(reference[:-1].ravel())
        self._problem.update_goal_state(reference[-1])
        self._program.update_cost_vector(self._problem)
        self._program.update_constraint_vector(self._problem)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._found = qpsolvers.solve_problem(
                self._program.problem, solver=self._backend, **self._accuracy
            )
        self._x0 = x0

    def plan(self) -> dict:
        """Return the last answer."""
        found = self._found.x is not None
        m = self._B.shape[1]
        u = self._found.x.reshape(-1, m) if found else np.zeros((self._N, m))
        x = [self._x0]
        for row in u:
            x.append(self._A @ x[-1] + self._B @ row)
        return {"x": x, "u": u, "status": "solved" if found else "failed: no answer"}


def _scalar(weight: np.ndarray, name: str) -> float:
    if np.ptp(np.diag(weight)) or np.any(weight - np.diag(np.diag(weight))):
        raise CannotTreat(f"weights are numbers; {name} is a matrix")
    return float(weight[0, 0])


def _inequalities(job: dict, A: np.ndarray, B: np.ndarray) -> dict:
    """Rows C x + D u <= e: inputs at 0 .. N - 1, states at 1 .. N."""
    on_u, limit_u = _rows(job["u_lower"], job["u_upper"])
    on_x, limit_x = _rows(job["x_lower"], job["x_upper"])
    zero_x, zero_u = np.zeros((len(limit_u), job["nx"])), np.zeros((len(limit_x), job["nu"]))
    states, inputs, limits = [], [], []
    for k in range(job["N"]):
        rows = [(zero_x, on_u, limit_u)]
        rows += [(on_x, zero_u, limit_x)] if k > 0 else []
        rows += [(on_x @ A, on_x @ B, limit_x)] if k == job["N"] - 1 else []
        c, d, e = zip(*rows, strict=True)
        states.append(np.vstack(c))
        inputs.append(np.vstack(d))
        limits.append(np.concatenate(e))
    return {
        "ineq_state_matrix": states,
        "ineq_input_matrix": inputs,
        "ineq_vector": limits,
    }


def _rows(lower: list[float], upper: list[float]) -> tuple[np.ndarray, np.ndarray]:
    identity = np.eye(len(lower))
    rows, limits = np.vstack([identity, -identity]), np.append(upper, -np.array(lower))
    kept = np.isfinite(limits)
    return rows[kept], limits[kept]


if __name__ == "__main__":
    serve(CondensedTracking)
