"""python-control: single shooting on our stage map in discrete time, SLSQP of scipy.

Its costs and constraints do not see time, so that a state counts the steps. Derivatives are
scipy's differences, or ours, handed through to ``minimize``.
"""

from collections.abc import Callable
from importlib.metadata import version

import control
import numpy as np
import scipy
from c_stage import compiled
from control import optimal
from scipy.optimize import Bounds, NonlinearConstraint
from slopes import RollOut
from wire import end_state, serve

_ITERATIONS = 500


class SingleShooting:
    """``OptimalControlProblem`` over the controls at the nodes; that of the end has no effect."""

    def __init__(self, job: dict) -> None:
        """State the problem."""
        self.versions = {
            "control": version("control"),
            "scipy": scipy.__version__,
            "numpy": np.__version__,
        }
        self.remark = "starts from controls alone"
        self._job, self._n, self._p = job, job["N"], np.zeros((job["N"] + 1, job["np"]))
        self._functions, self._x0 = compiled(job["c"]), np.zeros(job["nx"])
        self._run = RollOut(self._functions)
        is_ours = job["setting"] == "our derivatives"
        system = control.nlsys(
            self._next, None, inputs=job["nu"], states=job["nx"] + 1, dt=job["interval"]
        )
        self._problem = optimal.OptimalControlProblem(
            system,
            job["interval"] * np.arange(self._n + 1),
            self._cost,
            terminal_cost=self._end_cost,
            trajectory_constraints=self._bounds_of_states(),
            terminal_constraints=self._end(),
            minimize_method="SLSQP",
            minimize_options={"ftol": job["tolerance"], "maxiter": _ITERATIONS},
            minimize_kwargs={"bounds": self._boxes(), "jac": self._gradient if is_ours else None},
        )
        # It states those along the trajectory first.
        slopes = [slope for rows, slope in self._slopes() if rows.size]
        for constraint, slope in zip(self._problem.constraints, slopes, strict=True):
            constraint.jac = slope if is_ours else "2-point"

    def step(self, x0: np.ndarray, p: np.ndarray, guess: dict | None) -> None:
        """Solve from the guess, or from the last answer."""
        self._x0, self._p = x0, p
        start = self._last.inputs if guess is None else guess["u"][[*range(self._n), -1]].T
        self._last = self._problem.compute_trajectory(
            np.append(x0, 0.0), initial_guess=start, squeeze=False, print_summary=False
        )

    def plan(self) -> dict:
        """Return the last answer."""
        last = self._last
        word = "solved" if last.success else f"failed: {last.message}"
        x, u = last.states[:-1].T, last.inputs[:, :-1].T
        return {"x": x, "u": u, "status": f"{word}, {last.nit} iterations"}

    def _next(self, t, z, u, parameters):
        after = self._functions["stage"](z[:-1], u, self._p[int(z[-1])])[0]
        return np.append(after[:, 0], z[-1] + 1.0)

    def _cost(self, z, u):
        return float(self._functions["stage"](z[:-1], u, self._p[int(z[-1])])[1][0, 0])

    def _end_cost(self, z, u):
        return float(self._functions["terminal"](z[:-1], self._p[-1])[0][0, 0])

    def _boxes(self) -> Bounds:
        """Bounds of all controls, input by input, as its coefficients are."""
        sides = (np.repeat(self._job[f"u_{side}"], self._n + 1) for side in ("lower", "upper"))
        return Bounds(*sides)

    def _bounded(self) -> np.ndarray:
        sides = np.array([self._job["x_lower"], self._job["x_upper"]])
        return np.flatnonzero(np.isfinite(sides).any(axis=0))

    def _bounds_of_states(self) -> list[NonlinearConstraint]:
        """At every node but the first: the measured state is what it is."""
        rows = self._bounded()
        lower, upper = (np.array(self._job[f"x_{side}"])[rows] for side in ("lower", "upper"))

        def values(z: np.ndarray, u: np.ndarray) -> np.ndarray:
            return z[rows] if z[-1] > 0 else np.clip(z[rows], lower, upper)

        return [NonlinearConstraint(values, lower, upper)] if rows.size else []

    def _end(self) -> list[NonlinearConstraint]:
        end = end_state(self._job)
        rows, wanted = list(end), np.array(list(end.values()))
        return [NonlinearConstraint(lambda z, u: z[rows], wanted, wanted)] if rows else []

    def _gradient(self, coefficients: np.ndarray) -> np.ndarray:
        return self._run.gradient(self._x0, self._controls(coefficients), self._p).ravel()

    def _sensitivities(self, coefficients: np.ndarray) -> np.ndarray:
        found = self._run.sensitivities(self._x0, self._controls(coefficients), self._p)
        return found.reshape(*found.shape[:2], -1)

    def _controls(self, coefficients: np.ndarray) -> np.ndarray:
        return coefficients.reshape(self._job["nu"], -1)

    def _slopes(self) -> list[tuple[np.ndarray, Callable]]:
        """Rows and Jacobian: of the bounds of states, and of the prescribed end."""
        rows, end = self._bounded(), np.array(list(end_state(self._job)), dtype=int)
        return [
            (rows, lambda u: np.concatenate(self._sensitivities(u)[:, rows])),
            (end, lambda u: self._sensitivities(u)[-1][end]),
        ]


if __name__ == "__main__":
    serve(SingleShooting)
