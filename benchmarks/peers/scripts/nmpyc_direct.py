"""nmpyc: direct with IPOPT, on our stage map as a discrete system."""

from importlib.metadata import version

import casadi
import nmpyc
import numpy as np
from replay import function, reads_parameters
from wire import end_state, serve


class NmpycLoop:
    """What a step of its ``model.mpc`` does, from the state that we give; it simulates no plant.

    Where the dynamics depend on time, it builds its program anew in every step. Where costs
    alone do, its step would keep those of the first step, and its ``solve_ocp`` takes its place.
    Its guess are controls; it finds the states by simulation.
    """

    def __init__(self, job: dict) -> None:
        """State the problem."""
        self.versions = {name: version(name) for name in ("nmpyc", "casadi", "numpy")}
        self.remark = "starts from controls alone"
        self._n, self._h = job["N"], job["interval"]
        self._stage, self._end = (function(job[name], casadi) for name in ("stage", "terminal"))
        self._p = np.zeros((self._n + 1, job["np"]))
        system = nmpyc.system(
            lambda t, x, u: self._staged(t, x, u)[0], job["nx"], job["nu"], sampling_time=self._h
        )
        objective = nmpyc.objective(
            lambda t, x, u: self._staged(t, x, u)[1], lambda t, x: self._end(x._A, self._p[-1])
        )
        constraints = _bounds(job)
        self._model = nmpyc.model(objective, system, constraints)
        is_steady = not any(reads_parameters(job[name]) for name in ("stage", "terminal"))
        self._is_stated_anew = system.autonomous and not is_steady
        if not is_steady:
            self.remark += "; depends on time: it builds its program anew in every step"
        self._options = self._model.opti
        self._options.set_options({"solver": "ipopt", "tol": job["tolerance"]})
        # What it calls its tolerance is that of an acceptable point; this is that of IPOPT.
        self._options.set_solverOptions({"tol": job["tolerance"]})
        self._options.init_solver(objective, system, constraints, self._n)

    def _staged(self, t: float | casadi.MX, x: nmpyc.array, u: nmpyc.array) -> tuple:
        """State after a stage and its cost, with the parameters of the node at t."""
        if isinstance(t, casadi.MX):  # it asks whether the dynamics depend on time
            return self._stage(x._A, u._A, casadi.vertcat(t, self._p[0, 1:]))
        k = round((t - self._p[0, 0]) / self._h)
        return self._stage(x._A, u._A, self._p[min(max(k, 0), self._n)])

    def step(self, x0: np.ndarray, p: np.ndarray, guess: dict | None) -> None:
        """Solve from the guess, or from the last answer."""
        self._p, start, t = p, nmpyc.array(x0.tolist()), float(p[0, 0])
        if guess is not None:
            self._options.U_start = nmpyc.array(guess["u"].T.tolist())
            self._x, self._u = guess["x"], guess["u"]
        if self._is_stated_anew:
            self._model.system.t0 = t
            u, x = self._model.solve_ocp(start, self._n)
        else:
            u, x = self._options.solve(t, start)
        self._status = f"failed: {str(x).splitlines()[-1]}" if u is None else "solved"
        if u is not None:
            self._u, self._x = (np.array(nmpyc.convert(z, "numpy")).T for z in (u, x))

    def plan(self) -> dict:
        """Return the last answer."""
        return {"x": self._x, "u": self._u, "status": self._status}


def _bounds(job: dict) -> nmpyc.constraints:
    found = nmpyc.constraints()
    for side in ("lower", "upper"):
        end = np.array(job[f"x_{side}"])
        for i, value in end_state(job).items():
            end[i] = value
        rows = {"state": job[f"x_{side}"], "control": job[f"u_{side}"], "terminal": end}
        for what, values in rows.items():
            found.add_bound(side, what, nmpyc.array(np.asarray(values).tolist()))
    return found


if __name__ == "__main__":
    serve(NmpycLoop)
