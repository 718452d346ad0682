"""Feasibility restoration: the trajectory whose largest constraint violation is smallest."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.internal import QUIET, BufferedNlp, ConstraintRow
from solvers.direct.nlp_result import NlpResult
from solvers.direct.transcribed_problem import TranscribedProblem

# Weight of the cost, which only selects one among the least violating trajectories.
_TIE_BREAK = 1e-4
# A violation up to this is none.
_NONE = 1e-6


@dataclass(frozen=True, eq=False)
class LeastViolation:
    """A trajectory that violates the constraints as little as possible, near a first iterate.

    Attributes:
        result: the trajectory, with its cost and without multipliers.
        violation: the largest one that is left.
        row: what is violated by that much; None: nothing is.
    """

    result: NlpResult
    violation: float
    row: ConstraintRow | None


@dataclass(frozen=True, eq=False)
class FeasibilityRestoration:
    r"""The elastic form of a transcribed problem.

    .. math:: \min_{w,\, s \ge 0} s \quad \text{s.t.} \quad
              \text{lower} - s \le g_i(w) \le \text{upper} + s

    for the path and terminal constraints and the state bounds; dynamics, start and control
    bounds are not relaxed. The solution is a local one: if s > 0 there the problem is
    infeasible near that trajectory.

    Attributes:
        transcription: the problem on its grid.
        time_limit: for one solve [s].
    """

    transcription: TranscribedProblem
    time_limit: float = np.inf

    @cached_property
    def _soft(self) -> np.ndarray:
        """Whether a constraint is relaxed, bool (m,)."""
        return np.array([r.place in ("path", "terminal") for r in self.transcription.rows])

    @cached_property
    def _states(self) -> np.ndarray:
        """Whether the bounds of an unknown are relaxed, bool (size,): states after the start."""
        return self.transcription.is_later_state

    @cached_property
    def _nlp(self) -> BufferedNlp:
        """The elastic problem with its solver; built at the first use, which is rare."""
        program = self.transcription.program
        w, g, s = program["x"], program["g"], ca.MX.sym("s")
        soft, states = (
            [int(i) for i in np.flatnonzero(mask)] for mask in (self._soft, self._states)
        )
        hard = [int(i) for i in np.flatnonzero(~self._soft)]
        relaxed = ca.vertcat(g[hard], g[soft] + s, g[soft] - s, w[states] + s, w[states] - s)
        tie_break = ca.MX.sym("tie break")
        nlp = {"x": ca.vertcat(w, s), "f": s + tie_break * program["f"], "g": relaxed}
        nlp["p"] = ca.vertcat(program["p"], tie_break)
        options = QUIET | {
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.max_iter": 300,
        }
        if self.time_limit < np.inf:
            options["ipopt.max_wall_time"] = self.time_limit
        function = ca.nlpsol("elastic", "ipopt", nlp, options)
        return BufferedNlp(function)

    def least_violating(
        self, w0: np.ndarray, bounds: dict[str, np.ndarray], p: np.ndarray
    ) -> LeastViolation | None:
        """Solve the elastic problem; None if that fails.

        Where a violation is left, or nothing is found, once more without the cost: it may be so
        large where the constraints hold that no weight makes it a mere tie break.

        Args:
            w0: first iterate.
            bounds: of the problem itself: lbx, ubx, lbg, ubg.
            p: data of the problem.
        """
        soft, states = self._soft, self._states
        inf_soft, inf_states = np.full(soft.sum(), np.inf), np.full(states.sum(), np.inf)
        lbg = [bounds["lbg"][~soft], bounds["lbg"][soft], -inf_soft]
        ubg = [bounds["ubg"][~soft], inf_soft, bounds["ubg"][soft]]
        lbg += [bounds["lbx"][states], -inf_states]
        ubg += [inf_states, bounds["ubx"][states]]
        inputs = {
            "lbx": np.append(np.where(states, -np.inf, bounds["lbx"]), 0.0),
            "ubx": np.append(np.where(states, np.inf, bounds["ubx"]), np.inf),
            "lbg": np.concatenate(lbg),
            "ubg": np.concatenate(ubg),
        }
        found = None
        for weight in (_TIE_BREAK, 0.0):
            again = self._solved(w0 if found is None else found.result.w, p, weight, inputs, bounds)
            if again and (found is None or again.violation < found.violation):
                found = again
            if found and found.violation <= _NONE:
                break
        return found

    def _solved(
        self,
        w0: np.ndarray,
        p: np.ndarray,
        weight: float,
        inputs: dict[str, np.ndarray],
        bounds: dict[str, np.ndarray],
    ) -> LeastViolation | None:
        given = {"x0": np.append(w0, 1.0), "p": np.append(p, weight)}
        solution, stats = self._nlp(inputs | given)
        w = solution["x"][:-1]
        if not stats["success"] or not np.isfinite(w).all():
            return None
        cost, g = (np.array(value).ravel() for value in self._values(w, p))
        result = NlpResult(w, float(cost[0]), g, np.zeros_like(w), np.zeros_like(g), stats)
        violation, row = self.transcription.worst(w, g, bounds)
        return LeastViolation(result, violation, row)

    @cached_property
    def _values(self) -> ca.Function:
        """Cost and constraints of the problem itself."""
        program = self.transcription.program
        inputs, outputs = (program["x"], program["p"]), (program["f"], program["g"])
        return ca.Function("values", inputs, outputs)
