"""do-mpc: the same stage map as a discrete model, solved by IPOPT; and its own collocation."""

from importlib.metadata import version

import casadi
import do_mpc
import numpy as np
from replay import with_casadi
from wire import CannotTreat, end_state, serve


class DoMpcLoop:
    """Its MPC class: parameters along the horizon are its ``_tvp``."""

    def __init__(self, job: dict) -> None:
        """State the problem."""
        self.versions = {name: version(name) for name in ("do-mpc", "casadi", "numpy")}
        held = job["setting"] == "same grid"
        if not held and job["rate"] is None:
            raise CannotTreat("collocation is for continuous time")
        self.remark = "" if held else "Radau collocation of order 2, the cost summed over the nodes"
        self._job, self._p = job, np.zeros((job["N"] + 1, job["np"]))
        model = do_mpc.model.Model("discrete" if held else "continuous", "SX")
        x = model.set_variable("_x", "x", (job["nx"], 1))
        u = model.set_variable("_u", "u", (job["nu"], 1))
        p = model.set_variable("_tvp", "p", (job["np"], 1))
        law = job["stage"] if held else job["rate"]
        model.set_rhs("x", with_casadi(law, [x, u, p], casadi)[0])
        model.setup()
        x, u, p = model.x["x"], model.u["u"], model.tvp["p"]  # others than before the set-up
        self._mpc = mpc = do_mpc.controller.MPC(model)
        mpc.settings.n_horizon = job["N"]
        mpc.settings.t_step = job["interval"]
        mpc.settings.store_full_solution = False
        mpc.settings.nlpsol_opts = {
            "ipopt.tol": job["tolerance"],
            "ipopt.print_level": 0,
            "print_time": 0,
            "ipopt.sb": "yes",
        }
        if not held:
            mpc.settings.collocation_type = "radau"
            mpc.settings.collocation_deg = 2
            mpc.settings.collocation_ni = 1
        end = with_casadi(job["terminal"], [x, p], casadi)[0]
        cost = with_casadi(law, [x, u, p], casadi)[1]
        # It sums the running cost over the nodes, whatever the model is.
        mpc.set_objective(mterm=end, lterm=cost if held else job["interval"] * cost)
        mpc.set_rterm(u=0.0)
        for kind, name in (("_x", "x"), ("_u", "u")):
            for side in ("lower", "upper"):
                mpc.bounds[side, kind, name] = np.array(job[f"{name}_{side}"])
        lower, upper = np.array(job["x_lower"]), np.array(job["x_upper"])
        for i, value in end_state(job).items():
            lower[i] = upper[i] = value
        mpc.terminal_bounds["lower", "x"], mpc.terminal_bounds["upper", "x"] = lower, upper
        template = mpc.get_tvp_template()

        def ahead(_: float) -> object:
            for k in range(job["N"] + 1):
                template["_tvp", k, "p"] = self._p[k]
            return template

        mpc.set_tvp_fun(ahead)
        mpc.setup()

    def step(self, x0: np.ndarray, p: np.ndarray, guess: dict | None) -> None:
        """Solve from the guess, or from the last answer."""
        mpc = self._mpc
        self._p = p
        if guess is not None:
            mpc.x0 = x0
            mpc.set_initial_guess()
            found = mpc.opt_x_num
            for k in range(self._job["N"] + 1):
                for collocated in range(len(found["_x", k, 0])):
                    found["_x", k, 0, collocated] = guess["x"][k]
            for k in range(self._job["N"]):
                found["_u", k, 0] = guess["u"][k]
        mpc.make_step(x0)

    def plan(self) -> dict:
        """Return the last answer."""
        n, found = self._job["N"], self._mpc.opt_x_num
        stats = self._mpc.solver_stats
        word = stats["return_status"]
        return {
            "x": [np.array(found["_x", k, 0, -1]).ravel() for k in range(n + 1)],
            "u": [np.array(found["_u", k, 0]).ravel() for k in range(n)],
            "status": "solved" if stats["success"] else f"failed: {word}",
        }


if __name__ == "__main__":
    serve(DoMpcLoop)
