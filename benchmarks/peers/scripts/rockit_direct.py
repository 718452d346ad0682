"""rockit: direct multiple shooting with its own Runge-Kutta step, IPOPT, as one Function."""

from importlib.metadata import version

import casadi
import numpy as np
from replay import function
from rockit import MultipleShooting, Ocp
from wire import end_state, serve


class Shooting:
    """What it recommends for a controller: everything compiled into a Function of its data."""

    def __init__(self, job: dict) -> None:
        """State the problem and make the Function."""
        self.versions = {name: version(name) for name in ("rockit-meco", "casadi", "numpy")}
        self.remark = ""
        self._n, self._is_discrete = job["N"], job["rate"] is None
        ocp = Ocp(T=job["N"] * job["interval"])
        x, u = ocp.state(job["nx"]), ocp.control(job["nu"])
        x0, last = ocp.parameter(job["nx"]), ocp.parameter(job["np"])
        if self._is_discrete:
            p = ocp.parameter(job["np"], grid="control")
            after, cost = function(job["stage"], casadi)(x, u, p)
            ocp.set_next(x, after)
            ocp.add_objective(ocp.sum(cost))
        else:
            p = ocp.parameter(job["np"])  # the time at which the horizon begins
            rate, cost = function(job["rate"], casadi)(x, u, p + ocp.t)
            ocp.set_der(x, rate)
            ocp.add_objective(ocp.integral(cost))
        ocp.add_objective(ocp.at_tf(function(job["terminal"], casadi)(x, last)))
        ocp.subject_to(ocp.at_t0(x) == x0)
        _bound(ocp, u, job["u_lower"], job["u_upper"])
        _bound(ocp, x, job["x_lower"], job["x_upper"], include_first=False)
        for i, value in end_state(job).items():
            ocp.subject_to(ocp.at_tf(x[i]) == value)
        options = {"ipopt.tol": job["tolerance"], "ipopt.print_level": 0, "print_time": False}
        ocp.solver("ipopt", {**options, "ipopt.sb": "yes", "expand": True, "error_on_fail": True})
        ocp.method(MultipleShooting(N=job["N"], M=1, intg="rk"))
        for parameter, width in ((x0, job["nx"]), (last, job["np"])):
            ocp.set_value(parameter, np.zeros(width))  # it wants a value before it has any
        ocp.set_value(p, np.zeros((job["np"], job["N"] if self._is_discrete else 1)))
        along = ocp.sample(p, grid="control-")[1] if self._is_discrete else p
        states, controls = ocp.sample(x, grid="control")[1], ocp.sample(u, grid="control-")[1]
        given = [x0, along, last, states, controls]
        self._solve = ocp.to_function("solve", given, [states, controls])
        self._found = None

    def step(self, x0: np.ndarray, p: np.ndarray, guess: dict | None) -> None:
        """Solve from the guess, or from the last answer."""
        start = (guess["x"].T, guess["u"].T) if guess else self._found
        try:
            along = p[:-1].T if self._is_discrete else p[0]
            self._found = self._solve(x0, along, p[-1], *start)
            self._status = "solved"
        except RuntimeError as error:
            self._found = start
            self._status = f"failed: {str(error).splitlines()[-1]}"
        np.array(self._found[1][:, 0])

    def plan(self) -> dict:
        """Return the last answer."""
        x, u = (np.array(rows).T for rows in self._found)
        return {"x": x, "u": u, "status": self._status}


def _bound(ocp: Ocp, what: casadi.MX, lower: list, upper: list, **where: bool) -> None:
    for i, (low, high) in enumerate(zip(lower, upper, strict=True)):
        if np.isfinite(low) and np.isfinite(high):
            ocp.subject_to(low <= (what[i] <= high), **where)


if __name__ == "__main__":
    serve(Shooting)
