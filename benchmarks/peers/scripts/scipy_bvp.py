"""scipy's solve_bvp on the equations of the minimum principle, derived by us."""

from typing import Any

import numpy as np
import scipy
from replay import with_numpy
from scipy.integrate import solve_bvp
from wire import CannotTreat, end_state, serve

_MOST_NODES = 10_000


class BoundaryValueProblem:
    """State and costate over the horizon; the control is the minimiser of the Hamiltonian."""

    def __init__(self, job: dict) -> None:
        """Refuse a problem whose Hamiltonian does not determine the control."""
        if job["extremal"] is None:
            raise CannotTreat(f"it needs the minimum principle: {job['why_no_extremal']}")
        self.versions = {"scipy": scipy.__version__, "numpy": np.__version__}
        self.remark = "own mesh, control not held; does not impose bounds of states"
        self._job, self._end = job, end_state(job)
        self._nx = job["nx"]
        self._last: Any = None

    def step(self, x0: np.ndarray, p: np.ndarray, guess: dict | None) -> None:
        """Solve on the mesh of the job, from the guess with costates 0, or from the last answer."""
        times = p[:, 0]
        tolerance = max(self._job["tolerance"], 100 * np.finfo(float).eps)
        if guess is None and self._last is not None:
            mesh, y = times, self._last.sol(np.clip(times, *self._last.x[[0, -1]]))
        else:
            mesh, y = times, np.vstack([guess["x"].T, 0.0 * guess["x"].T])
        self._last = solve_bvp(
            lambda t, y: with_numpy(self._job["extremal"]["flow"], [y, t[None]])[0],
            lambda ya, yb: np.concatenate([ya[: self._nx] - x0, self._at_end(yb, p[-1])]),
            mesh,
            y,
            tol=tolerance,
            max_nodes=_MOST_NODES,
        )

    def _at_end(self, y, p):
        """What vanishes at the end: a prescribed state, or costate less gradient of its cost."""
        x, costate = y[: self._nx], y[self._nx :]
        slope = with_numpy(self._job["extremal"]["end"], [x, p])[0]
        free = costate - slope
        return np.array([x[i] - self._end[i] if i in self._end else free[i] for i in range(len(x))])

    def plan(self) -> dict:
        """Return the last answer on its own mesh."""
        y, t = self._last.y, self._last.x
        u = with_numpy(self._job["extremal"]["flow"], [y, t[None]])[1]
        good = self._last.status == 0
        return {
            "t": t,
            "x": y[: self._nx].T,
            "costate": y[self._nx :].T,
            "u": u.reshape(-1, len(t)).T,
            "status": "solved" if good else f"failed: {self._last.message}",
        }


if __name__ == "__main__":
    serve(BoundaryValueProblem)
