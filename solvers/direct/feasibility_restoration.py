"""Can the constraints be met at all? The smallest largest violation near a trajectory."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.internal import ConstraintRow
from solvers.direct.nlp_backends import NlpResult
from solvers.direct.transcribed_problem import TranscribedProblem

# The cost, scaled by this, only picks one among the least violating trajectories.
_TIE_BREAK = 1e-4


@dataclass(frozen=True, eq=False)
class FeasibilityRestoration:
    r"""The elastic form of a transcribed problem.

    .. math:: \min_{w,\, s \ge 0} s \quad \text{s.t.} \quad
              \text{lower} - s \le g_i(w) \le \text{upper} + s

    for the path and terminal constraints and the state bounds, while the dynamics, the
    start and the control bounds hold as they are. A local answer: what it calls infeasible is
    infeasible near where it looked.

    Attributes:
        transcription: the problem on its grid.
        time_limit: for a search [s].
    """

    transcription: TranscribedProblem
    time_limit: float = np.inf

    @cached_property
    def _soft(self) -> np.ndarray:
        return np.array([r.place in ("path", "terminal") for r in self.transcription.rows])

    @cached_property
    def _states(self) -> np.ndarray:
        """Whether an unknown is a state that may leave its bounds; the start may not."""
        return self.transcription.is_later_state

    @cached_property
    def _nlp(self) -> ca.Function:
        program = self.transcription.program
        w, g, s = program["x"], program["g"], ca.MX.sym("s")
        soft, states = (
            [int(i) for i in np.flatnonzero(mask)] for mask in (self._soft, self._states)
        )
        hard = [int(i) for i in np.flatnonzero(~self._soft)]
        relaxed = ca.vertcat(g[hard], g[soft] + s, g[soft] - s, w[states] + s, w[states] - s)
        nlp = {"x": ca.vertcat(w, s), "f": s + _TIE_BREAK * program["f"], "g": relaxed}
        options = {
            "print_time": False,
            "error_on_fail": False,
            "show_eval_warnings": False,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.max_iter": 300,
        }
        if self.time_limit < np.inf:
            options["ipopt.max_wall_time"] = self.time_limit
        return ca.nlpsol("elastic", "ipopt", {**nlp, "p": program["p"]}, options)

    def least_violating(
        self, w0: np.ndarray, bounds: dict[str, np.ndarray], p: np.ndarray
    ) -> tuple[NlpResult, float, ConstraintRow | None] | None:
        """Return the answer, the violation that is left and where; None if nothing was found.

        Args:
            w0: first iterate.
            bounds: of the problem itself.
            p: its data.
        """
        soft, states = self._soft, self._states
        inf_soft, inf_states = np.full(soft.sum(), np.inf), np.full(states.sum(), np.inf)
        lbg = [bounds["lbg"][~soft], bounds["lbg"][soft], -inf_soft]
        ubg = [bounds["ubg"][~soft], inf_soft, bounds["ubg"][soft]]
        lbg += [bounds["lbx"][states], -inf_states]
        ubg += [inf_states, bounds["ubx"][states]]
        answer = self._nlp(
            x0=np.append(w0, 1.0),
            p=p,
            lbx=np.append(np.where(states, -np.inf, bounds["lbx"]), 0.0),
            ubx=np.append(np.where(states, np.inf, bounds["ubx"]), np.inf),
            lbg=np.concatenate(lbg),
            ubg=np.concatenate(ubg),
        )
        w, stats = np.array(answer["x"]).ravel()[:-1], self._nlp.stats()
        if not stats["success"] or not np.isfinite(w).all():
            return None
        cost, g = (np.array(value).ravel() for value in self._values(w, p))
        nothing = np.zeros_like(g)
        found = NlpResult(w, float(cost[0]), g, np.zeros_like(w), nothing, stats)
        return found, *self.transcription.worst(w, g, bounds)

    @cached_property
    def _values(self) -> ca.Function:
        program = self.transcription.program
        inputs, outputs = (program["x"], program["p"]), (program["f"], program["g"])
        return ca.Function("values", inputs, outputs)
