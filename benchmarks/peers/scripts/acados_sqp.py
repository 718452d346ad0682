"""acados: SQP with HPIPM on generated C, exact Hessian; to convergence, or one iteration a step."""

import ctypes
import os
from importlib.metadata import version

import acados
import casadi
import numpy as np
from replay import with_casadi
from wire import end_state, serve

# Its generator looks for its libraries here.
os.environ["ACADOS_SOURCE_DIR"] = acados.DIR
os.environ["TERA_PATH"] = acados.TERA_PATH
os.environ["ACADOS_PYTHON_INTERFACE_PATH"] = acados.TEMPLATE_DIR
# What it generates asks for these by names under which only loaded ones are found.
for _name in ("blasfeo", "hpipm", "qpOASES_e"):
    ctypes.CDLL(os.path.join(acados.LIB_DIR, f"lib{_name}.so"), mode=ctypes.RTLD_GLOBAL)

from acados.acados_template import AcadosModel, AcadosOcp, AcadosOcpSolver  # noqa: E402

_ITERATIONS = 200
# Real-time iteration presumes that it once was at a solution: so often it iterates at first.
_FIRST = 20
_WORDS = {
    0: "solved",
    1: "failed: NaN",
    2: "failed: iteration limit",
    3: "failed: smallest step",
    4: "failed: its QP has no solution",
}


class Acados:
    """The same stage map as discrete dynamics, its cost as external cost."""

    def __init__(self, job: dict) -> None:
        """State the problem."""
        self.versions = {
            "comma-deps-acados": version("comma-deps-acados"),
            "casadi": casadi.__version__,
            "numpy": np.__version__,
        }
        self._first = _FIRST if job["setting"] == "RTI" else 1
        self.remark = (
            f"Gauss-Newton, one iteration a step, {_FIRST} cold" if self._first > 1 else ""
        )
        self._job = job
        self._solver = AcadosOcpSolver(_stated(job), json_file="job.json")

    def step(self, x0: np.ndarray, p: np.ndarray, guess: dict | None) -> None:
        """Solve from the guess, or from the last answer."""
        solver, n = self._solver, self._job["N"]
        if guess is not None:
            for k in range(n):
                solver.set(k, "u", guess["u"][k])
                solver.set(k, "pi", 0.0 * x0)
            for k in range(n + 1):
                solver.set(k, "x", guess["x"][k])
        for k in range(n + 1):
            solver.set(k, "p", p[k])
        solver.set(0, "lbx", x0)
        solver.set(0, "ubx", x0)
        for _ in range(self._first if guess is not None else 1):
            self._status = solver.solve()
        solver.get(0, "u")

    def plan(self) -> dict:
        """Return the last answer."""
        solver, n = self._solver, self._job["N"]
        iterations = int(np.sum(solver.get_stats("sqp_iter")))
        word = _WORDS.get(self._status, f"failed: status {self._status}")
        return {
            "x": [solver.get(k, "x") for k in range(n + 1)],
            "u": [solver.get(k, "u") for k in range(n)],
            "status": f"{word}, {iterations} iterations",
        }


def _stated(job: dict) -> AcadosOcp:
    ocp, model = AcadosOcp(acados.DIR), AcadosModel()
    x, u, p = (casadi.SX.sym(name, job[f"n{name}"]) for name in ("x", "u", "p"))
    after, cost = with_casadi(job["stage"], [x, u, p], casadi)
    model.name, model.x, model.u, model.p = "job", x, u, p
    model.disc_dyn_expr = after
    # It multiplies the cost of a stage by the length of its interval.
    model.cost_expr_ext_cost = cost / job["interval"]
    model.cost_expr_ext_cost_e = with_casadi(job["terminal"], [x, p], casadi)[0]
    ocp.model, ocp.parameter_values = model, np.zeros(job["np"])
    ocp.dims.N = job["N"]
    ocp.cost.cost_type = ocp.cost.cost_type_e = "EXTERNAL"
    _bound(ocp, job)
    options = ocp.solver_options
    options.tf = job["N"] * job["interval"]
    options.integrator_type = "DISCRETE"
    options.nlp_solver_type = "SQP_RTI" if job["setting"] == "RTI" else "SQP"
    # With an external cost, Gauss-Newton leaves out the curvature of the dynamics only.
    no_curvature = job["setting"] != "SQP"
    options.hessian_approx = "GAUSS_NEWTON" if no_curvature else "EXACT"
    options.regularize_method = "PROJECT"
    options.qp_solver = "PARTIAL_CONDENSING_HPIPM"
    options.nlp_solver_max_iter = _ITERATIONS
    options.tol = job["tolerance"]
    options.ext_fun_compile_flags = "-O3 -march=native"
    return ocp


def _bound(ocp: AcadosOcp, job: dict) -> None:
    """Bounds where there are some: at 0 the state is given, at N the end may be prescribed."""
    c = ocp.constraints
    c.x0 = np.zeros(job["nx"])
    for kind, end in (("u", ""), ("x", ""), ("x", "_e")):
        lower, upper = np.array(job[f"{kind}_lower"]), np.array(job[f"{kind}_upper"])
        for i, value in end_state(job).items() if end else ():
            lower[i] = upper[i] = value
        bounded = np.flatnonzero(np.isfinite(lower) | np.isfinite(upper))
        if bounded.size:
            setattr(c, f"idxb{kind}{end}", bounded)
            setattr(c, f"lb{kind}{end}", np.maximum(lower[bounded], -1e9))
            setattr(c, f"ub{kind}{end}", np.minimum(upper[bounded], 1e9))


if __name__ == "__main__":
    serve(Acados)
