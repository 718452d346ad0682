"""From a measurement to an input that somebody answers for: the rungs, best first."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite

import numpy as np

from ocp.constraint import Box
from ocp.mpc.applied import Applied, Sending
from ocp.mpc.asking import INSIDE, asked
from ocp.mpc.decision import ControlRefused, Outcome
from ocp.mpc.fallback import Answer, Backup
from ocp.mpc.rehearsal import Ends, Rehearsal
from ocp.mpc.shift import Shifted, controls
from ocp.parameters import ParameterValues
from ocp.problem import OCP
from ocp.solution import Solution
from ocp.solver import Program, Start
from ocp.status import Status

# Not converged, but with a trajectory that may be worth applying.
_USABLE = frozenset(
    {
        Status.MYOPIC,
        Status.SMALL_DECREASE,
        Status.COST_ROSE,
        Status.ITERATION_LIMIT,
        Status.TIME_LIMIT,
        Status.NO_PROGRESS,
        # A measured state may violate what from the next node on can be met.
        Status.INFEASIBLE,
    }
)
# Of an instant, relative to the interval: later than the end by less is the end.
_ROUNDING = 1e-6
_NO_PARAMETERS = np.empty(0)


@dataclass(slots=True, eq=False)
class Moment:
    """What a decision is made from; not frozen, which would take twice as long to make.

    Attributes:
        t: when the state was measured [s].
        at: when the input acts [s].
        start: the state then (nx,), predicted where need be.
        is_measured: False where the measurement is missing; the last plan's state stands in, if
            there is one.
        plan: the last good one.
        values: parameters and signals of a horizon.
        parameters: the same by name.
        since: where that horizon begins [s]: at ``at``, or where the last plan began.
        is_informed: False where nobody could say the parameters of the horizon from ``at`` on,
            and those of the last plan stand in as far as they reach.
        starts_afresh: whether the solver is not to start from the last plan.
        reasons: why the rungs above do not hold, in words; grows on the way down.
    """

    t: float
    at: float
    start: np.ndarray
    is_measured: bool
    plan: Solution | None
    values: ParameterValues
    parameters: Mapping[str, np.ndarray]
    since: float
    is_informed: bool
    starts_afresh: bool
    reasons: list[str]

    @property
    def is_solvable(self) -> bool:
        """Whether a solver has what it needs."""
        return self.is_measured and self.is_informed


@dataclass(slots=True, eq=False)
class Choice:
    """An input that a rung answers for; not frozen, as a ``Moment``.

    Attributes:
        outcome: which rung.
        input: within its bounds (m,).
        clipped: by how much it was moved to lie there.
        plan: that it comes from; None for the backup law.
    """

    outcome: Outcome
    input: np.ndarray
    clipped: float
    plan: Solution | None


@dataclass(frozen=True, eq=False, kw_only=True)
class Ladder:
    """The rungs of one controller; each returns a choice, or None and a reason.

    Attributes:
        ocp: the problem.
        program: solves it.
        applied: what the plant receives.
        guess: where the first step starts.
        backup: the law of the last rung.
        dt: sampling interval [s].
        tolerance: what still counts as inside.
        compiled: whether the model runs as machine code.
    """

    ocp: OCP
    program: Program
    applied: Applied
    guess: Start | None
    backup: Backup
    dt: float
    tolerance: float
    compiled: bool
    _rehearsals: dict[int, Rehearsal] = field(default_factory=dict)

    def solve(self, moment: Moment) -> tuple[Solution | None, Status | None]:
        """Return a new plan that meets the constraints, and how the solver ended."""
        if not moment.is_measured:
            moment.reasons.append("the measurement is not finite")
        if not moment.is_solvable:
            return None, None
        last = None if moment.starts_afresh else moment.plan
        try:
            plan = self.program.run(
                x0=moment.start,
                t0=moment.at,
                parameters=moment.parameters,
                guess=Shifted(last, moment.at) if last else self.guess,
            )
        except INSIDE as error:
            moment.reasons.append(f"{type(error).__name__} inside the solver: {error}")
            return None, None
        excess, worst = self._excess(plan, moment)
        if excess > self.tolerance:
            moment.reasons.append(f"{plan.status.name}: {plan.message or worst}")
            return None, plan.status
        if plan.status is not Status.SOLVED:
            moment.reasons.append(f"{plan.status.name}: {plan.message or plan.status.value}")
        return plan, plan.status

    def new(self, moment: Moment, plan: Solution) -> Choice | None:
        """Follow the new plan."""
        outcome = Outcome.OPTIMAL if plan.status is Status.SOLVED else Outcome.FEASIBLE
        return self._following(plan, moment, outcome)

    def shifted(self, moment: Moment) -> Choice | None:
        """Follow the last good plan, if its remainder meets the constraints."""
        if moment.plan is None:
            moment.reasons.append("there is no earlier plan")
            return None
        excess, worst = self._rehearsed(moment.plan, moment)
        if excess > self.tolerance:
            moment.reasons.append(f"the earlier plan: {worst}")
            return None
        return self._following(moment.plan, moment, Outcome.SHIFTED)

    def backed_up(self, moment: Moment, last: np.ndarray | None) -> Choice | None:
        """Ask the backup law; where it holds and has no answer, hold the last input."""
        choice = self._by_law(moment, self.backup.law) if self.backup.law else None
        if choice or not self.backup.holds:
            if self.backup.law is None:
                moment.reasons.append("there is no backup law")
            return choice
        if last is None:
            moment.reasons.append("there is no input to hold")
            return None
        moment.reasons.append("backup: hold")
        return self._within(moment, last, Outcome.BACKUP)

    def _by_law(self, moment: Moment, law: Answer) -> Choice | None:
        """Ask the backup law."""
        p = self._parameters(moment, moment.at)
        try:
            given = asked(lambda x, t: law(x, t, p), "the backup law", moment.start, moment.at)
        except ControlRefused as refusal:
            moment.reasons.append(str(refusal))
            return None
        needed = self.applied.size(self.ocp)
        if len(given) != needed:
            moment.reasons.append(f"the backup law returned {len(given)} numbers, not {needed}")
            return None
        choice = self._within(moment, given, Outcome.BACKUP)
        if choice:
            moment.reasons.append(f"backup: {self.backup.name}")
        return choice

    def advanced(self, x: np.ndarray, given: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
        """Return the model's state one interval after t [s] under an input, parameters held."""
        if self.applied.what == "rate":
            return x + self.dt * given
        times, ends = np.array([t, t + self.dt]), (p[None, :], p[None, :])
        return self._rehearsal(1).of(x, given[None, :], times, ends).x[-1]

    # -- pieces -------------------------------------------------------------------------------

    def _excess(self, plan: Solution, moment: Moment) -> tuple[float, str]:
        """Return by how much a new plan violates the constraints; inf where it is none."""
        if plan.status.is_success:
            if not self._is_constrained:
                return 0.0, ""
            u, ends = controls(plan, plan.t[:-1]), self._ends(moment, plan.t)
            return self._rehearsal(len(u)).excess(plan.x, u, plan.t, ends)
        if plan.status not in _USABLE:
            return np.inf, plan.status.value
        return self._rehearsed(plan, moment)

    def _rehearsed(self, plan: Solution, moment: Moment) -> tuple[float, str]:
        """Run the model from now under what is left of a plan, and check the constraints.

        Those of the end are asked of a whole plan only: a remainder ends before its horizon.
        """
        times = moment.at + plan.t - plan.t[0]
        left = int((times[:-1] < plan.t[-1] - _ROUNDING * self.dt).sum())
        if not left:
            return np.inf, "nothing is left of it"
        times = times[: left + 1]
        u, rehearsal = controls(plan, times[:-1]), self._rehearsal(left)
        trial = rehearsal.of(moment.start, u, times, self._ends(moment, times))
        found = trial.excess, trial.worst
        if left < len(plan.t) - 1 or not isfinite(trial.excess):
            return found
        p = self._parameters(moment, times[-1])
        return max(found, rehearsal.end_excess(trial.x[-1], times[-1], p))

    def _following(self, plan: Solution, moment: Moment, outcome: Outcome) -> Choice | None:
        """Follow a plan now; None where its input is none."""
        # A control that moves is held at its value in the middle of the interval, its mean but
        # for second-order terms.
        middle = 0.0 if plan.control_kind == "held" else 0.5 * self.dt
        u = controls(plan, moment.at + middle)
        given = self._sending(moment.start, u, moment.at, self._parameters(moment, moment.at))
        return self._within(moment, given, outcome, plan)

    def _within(
        self, moment: Moment, given: np.ndarray, outcome: Outcome, plan: Solution | None = None
    ) -> Choice | None:
        """Clip an input; None if it is not finite, or a plan's that is clipped by too much."""
        # Nearly all inputs need no clipping, and plain numbers say so sooner than numpy does.
        each = zip(given.tolist(), *self._limits, strict=True)
        if all([low <= value <= high for value, low, high in each]):
            return Choice(outcome, given.copy(), 0.0, plan)
        inside = self.box.clip(given)
        # Where an input is not finite, nor is this.
        excess = float(np.abs(given - inside).max())
        if not isfinite(excess):
            moment.reasons.append(f"the input {given} is not finite")
            return None
        if plan is not None and excess > self.tolerance:
            moment.reasons.append(f"the input {given} leaves its bounds by {excess:.3g}")
            return None
        return Choice(outcome, inside, excess, plan)

    def _ends(self, moment: Moment, times: np.ndarray) -> Ends:
        """Return the parameters at both ends of the intervals between some instants (N + 1,)."""
        return moment.values.on((times - moment.since) / self.ocp.duration)

    def _parameters(self, moment: Moment, t: float) -> np.ndarray:
        """Return the parameters at an instant (n_p,)."""
        if not self.ocp.parameters:
            return _NO_PARAMETERS
        return moment.values.at((t - moment.since) / self.ocp.duration)[0]

    def _rehearsal(self, n: int) -> Rehearsal:
        """Roll-outs over n intervals, prepared once for each n."""
        if n not in self._rehearsals:
            self._rehearsals[n] = Rehearsal(self.ocp, n, self.compiled)
        return self._rehearsals[n]

    @cached_property
    def _is_constrained(self) -> bool:
        """Whether there is anything along the way that a plan could violate."""
        ocp = self.ocp
        return bool(ocp.at("path")) or ocp.state_bounds.is_active or ocp.control_bounds.is_active

    @cached_property
    def _limits(self) -> tuple[list[float], list[float]]:
        """The bounds of the input as plain numbers, finite where there are none: inf is outside."""
        largest = np.finfo(float).max
        lower, upper = (
            np.clip(side, -largest, largest) for side in (self.box.lower, self.box.upper)
        )
        return lower.tolist(), upper.tolist()

    @cached_property
    def _sending(self) -> Sending:
        """What makes an input of a state and a control."""
        return self.applied.sending(self.ocp)

    @cached_property
    def box(self) -> Box:
        """Bounds of the input, each (m,)."""
        return self.applied.box(self.ocp)
