"""The elastic problem: least violation of constraints, and the fewest that exclude each other."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.internal import QUIET, BufferedNlp

# A constraint violated by more than this, relative to its size, counts as violated.
VIOLATED = 1e-5
# Weight of the distance from the first iterate, which picks one of many answers. The penalty on
# the slack is exact, so that what can be met has none.
_NEAR = 1e-5
_OPTIONS = QUIET | {
    "expand": True,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.max_iter": 120,
}


@dataclass(frozen=True)
class Demand:
    """One or several rows of constraints that share one slack.

    Attributes:
        where: the constraint, state or control it belongs to.
        label: its name in a sentence.
        unit: of its violation.
        size: the violation that counts as 1.
        is_control: whether it is a bound of a control.
        instant: when it holds [s], where it has an instant of its own.
    """

    where: tuple[str, ...]
    label: str
    unit: str = ""
    size: float = 1.0
    is_control: bool = False
    instant: float | None = None


@dataclass(frozen=True, eq=False)
class ElasticSolution:
    """A solution of the elastic problem.

    Attributes:
        w: the unknowns.
        slack: violation of each demand, (G,).
        weight: multiplier of every row, (m,).
        found: whether the solver converged.
    """

    w: np.ndarray
    slack: np.ndarray
    weight: np.ndarray
    found: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class ElasticProgram:
    r"""Demands with slack: L1 over the demands, the largest violation within each.

    .. math:: \min_{w,\, s \ge 0} \sum_g s_g / \text{size}_g \quad \text{s.t.} \quad
              \text{lower} - s_{g(i)} \le e_i(w) \le \text{upper} + s_{g(i)}, \quad
              \text{hard}(w) = 0

    A local solution: where the rows are not convex, demands that exclude each other do so near
    the first iterate. Source: [Chinneck 2008].

    Attributes:
        w: unknowns.
        p: data; empty where there are none.
        hard: must vanish, without slack.
        rows: e(w), (m,).
        lower: (m,).
        upper: (m,).
        owner: the demand each row belongs to, (m,).
        demands: all of them, G.
        box: bounds of w that are never relaxed, two arrays.
    """

    w: ca.MX
    p: ca.MX
    hard: ca.MX
    rows: ca.MX
    lower: np.ndarray
    upper: np.ndarray
    owner: np.ndarray
    demands: tuple[Demand, ...]
    box: tuple[np.ndarray, np.ndarray]

    @cached_property
    def _sizes(self) -> np.ndarray:
        return np.array([d.size for d in self.demands])

    @cached_property
    def _nlp(self) -> BufferedNlp:
        s = ca.MX.sym("s", len(self.demands))
        # Of a single demand, a list of indices would be a row.
        slack = ca.vec(s[[int(i) for i in self.owner]])
        near = ca.MX.sym("near", self.w.numel())
        apart = (self.w - near) / (1.0 + ca.fabs(near))
        nlp = {
            "x": ca.vertcat(self.w, s),
            "p": ca.vertcat(self.p, near),
            "f": ca.dot(s, ca.DM(1.0 / self._sizes)) + _NEAR * ca.sumsqr(apart),
            "g": ca.vertcat(self.hard, self.rows + slack, self.rows - slack),
        }
        return BufferedNlp(ca.nlpsol("elastic", "ipopt", nlp, _OPTIONS))

    def solve(
        self,
        w0: np.ndarray,
        p: np.ndarray,
        kept: Iterable[int],
        soft: Iterable[int] | None = None,
    ) -> ElasticSolution:
        """Solve with the ``kept`` demands only, of which the ``soft`` ones (all) have slack."""
        kept = list(kept)
        on = np.isin(self.owner, kept)
        gives = np.isin(np.arange(len(self.demands)), kept if soft is None else list(soft))
        many, zeros = np.full(len(on), np.inf), np.zeros(self.hard.numel())
        inputs = {
            "x0": np.append(w0, np.where(gives, self._sizes, 0.0)),
            "p": np.append(p, w0),
            "lbx": np.append(self.box[0], np.zeros(len(gives))),
            "ubx": np.append(self.box[1], np.where(gives, np.inf, 0.0)),
            "lbg": np.concatenate([zeros, np.where(on, self.lower, -np.inf), -many]),
            "ubg": np.concatenate([zeros, many, np.where(on, self.upper, np.inf)]),
        }
        answer, stats = self._nlp(inputs)
        values, rows = answer["x"], self.rows.numel()
        weights = answer["lam_g"][self.hard.numel() :].reshape(2, rows)
        finite = np.isfinite(values).all() and np.isfinite(weights).all()
        split = len(values) - len(gives)
        return ElasticSolution(
            w=values[:split],
            slack=np.maximum(values[split:], 0.0),
            weight=np.abs(weights).sum(axis=0),
            found=bool(stats["success"] and finite),
        )

    def excess(self, answer: ElasticSolution) -> np.ndarray:
        """Return the violation of each demand, relative to its size."""
        return answer.slack / self._sizes

    def is_possible(self, answer: ElasticSolution) -> bool:
        """Whether all demands are met."""
        return answer.found and float(self.excess(answer).sum()) <= VIOLATED

    def conflict(self, first: ElasticSolution, p: np.ndarray) -> tuple[int, ...]:
        """Return a smallest set of demands that exclude each other, by the deletion filter.

        Demands without a multiplier are removed at once, if the rest is still impossible; then
        each of the others is removed where the rest stays impossible.
        """
        weight = np.zeros(len(self.demands))
        np.add.at(weight, self.owner, first.weight)
        kept = list(range(len(self.demands)))
        needed = [i for i in kept if weight[i] > 1e-6 * weight.max(initial=0.0)]
        if len(needed) < len(kept) and self._impossible(first, p, needed):
            kept = needed
        for demand in sorted(kept, key=lambda i: weight[i]):
            fewer = [i for i in kept if i != demand]
            if fewer and self._impossible(first, p, fewer):
                kept = fewer
        return tuple(kept)

    def _impossible(self, first: ElasticSolution, p: np.ndarray, kept: list[int]) -> bool:
        answer = self.solve(first.w, p, kept)
        return answer.found and not self.is_possible(answer)
