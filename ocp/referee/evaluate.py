"""The referee: what a solution's controls really cost, violate and leave unoptimised."""

from dataclasses import dataclass
from typing import overload

import numpy as np

from ocp.checks.arguments import check_instance, check_positive
from ocp.checks.interrupts import interruptible
from ocp.checks.rich_text import html_of
from ocp.expressions.foreign_functions import without_derivatives
from ocp.normal_form.normal_form import normal_form
from ocp.problem.end_of_definition import end_of_definition
from ocp.referee.delayed_controls import with_acting_controls
from ocp.referee.integrate_controls import integrate_controls
from ocp.referee.memory import remembered
from ocp.referee.reference_trajectory import ReferenceTrajectory, Replay, adjoint
from ocp.referee.segments import defects, gaps, growth, worth
from ocp.referee.stationarity import final_costate, stationarity
from ocp.referee.verdict_in_words import verdict_facts, verdict_in_words
from ocp.referee.violation import invariant_drift, largest_violation, peaks
from ocp.solution.composite import CompositeSolution, V
from ocp.solution.control_rate import price_of_rates
from ocp.solution.solution import Solution

# Accepted error of the cost, relative to its size.
TOLERANCE = 1e-9
# States at which a function is looked for that has no value, the last known one among them.
_LOOKS = 30


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The verdict on a solution.

    Attributes:
        cost: true cost, inf if the controls make the state blow up, or no method resolves it, or
            one jumps whose ``Rate`` has a price.
        cost_error: bound of the error of the cost: from integrations of other accuracy and, by
            segments, what the gaps are worth by the solution's costates; inf where not known.
        violation: largest violation of any bound or constraint, between the nodes too.
        worst: which one, and when; empty where nothing is violated.
        stationarity: residual of the minimum principle, max over time of
            abs(u - clip(u - H_u)) with the referee's own costates, for a held control
            averaged over its interval, for a polynomial one by its coefficients, and of
            transversality at free ends; None where a path constraint or state bound is active
            (its multiplier would be needed), for stiff or unstable dynamics, along which
            explicit steps of the adjoint would not stay finite, and where an external function
            has no second derivatives.
        task_drift: largest violation of the problem's invariants.
        defect: largest distance of the solution's states from the true ones at its nodes.
        replay: ``"open loop"``: the controls are applied from the start to the end; or
            ``"by segments"``: from each node of the solution to the next, since the dynamics
            amplify the solution's tiny errors until open loop means nothing.
        gap: by segments, by how much their ends miss the next node at most; None in open loop.
        growth: by segments, the factor by which errors grow in open loop, relative to the size
            of each state; None in open loop.
        resolution: the largest distance of instants at which states, rows and costs are looked at
            [s]; anything shorter may be missed.
        truth: the trajectory itself.
    """

    cost: float
    cost_error: float
    violation: float
    worst: str
    stationarity: float | None
    task_drift: float
    defect: float
    replay: Replay
    gap: float | None
    growth: float | None
    resolution: float
    truth: ReferenceTrajectory

    def __repr__(self) -> str:
        """Return one line: what the controls cost, violate and leave unoptimised."""
        return f"<Evaluation: {verdict_in_words(self)}>"

    def _repr_html_(self) -> str:
        """Return the numbers, for a notebook."""
        return html_of("Evaluation", facts=verdict_facts(self, self.stationarity))


@overload
def evaluate(solution: Solution, *, tolerance: float = TOLERANCE) -> Evaluation: ...


@overload
def evaluate(solution: CompositeSolution[V], *, tolerance: float = TOLERANCE) -> V: ...


@interruptible
def evaluate(
    solution: Solution | CompositeSolution[V], *, tolerance: float = TOLERANCE
) -> Evaluation | V:
    """Judge a solution by integrating its controls, whatever its solver says.

    The latest verdicts are kept with the problem: the second call costs nothing.

    Args:
        solution: of any solver, with controls of any kind; or of ``Phases``.
        tolerance: accepted error of the cost, relative to its size, see ``integrate_controls``.

    Returns:
        the verdict, of phases a ``PhasesEvaluation``; nothing is raised for a bad trajectory, its
        numbers are bad.

    Raises:
        ProblemError: if it is no solution, or the tolerance not positive.
    """
    check_positive(tolerance, "evaluate: tolerance")
    if isinstance(solution, CompositeSolution):
        return solution.evaluated(tolerance)
    check_instance(solution, Solution, "evaluate: solution")
    return _evaluation(solution, tolerance)


@remembered
def _evaluation(solution: Solution, tolerance: float) -> Evaluation:
    solution = with_acting_controls(solution)
    truth = integrate_controls(solution, tolerance=tolerance)
    if not truth.is_finite:
        return _lost(solution, truth)
    violation, price = largest_violation(solution, truth), price_of_rates(solution)
    worst = "a control jumps that has a Rate" if np.isinf(price) else ""
    in_open_loop = truth.replay == "open loop"
    gap = None if in_open_loop else float(gaps(solution, truth).max())
    return Evaluation(
        cost=truth.cost + price + _price_of_peaks(solution, truth),
        cost_error=truth.cost_error + (0.0 if in_open_loop else worth(solution, truth)),
        violation=violation.amount,
        worst=violation.where if violation.amount > 0.0 else worst,
        stationarity=_stationarity(solution, truth),
        task_drift=invariant_drift(solution, truth),
        defect=float(defects(solution, truth).max()) if gap is None else gap,
        replay=truth.replay,
        gap=gap,
        growth=None if in_open_loop else growth(solution, truth),
        resolution=truth.resolution,
        truth=truth,
    )


def _price_of_peaks(solution: Solution, truth: ReferenceTrajectory) -> float:
    """What the largest values along the way cost, as far as they are looked at."""
    return float(np.dot([p.weight for p in solution.problem.peaks], peaks(solution, truth)))


def _stationarity(solution: Solution, truth: ReferenceTrajectory) -> float | None:
    """The residual of the minimum principle, which is that of the normal form."""
    if solution.normal is not None:
        return _evaluation(solution.normal, TOLERANCE).stationarity
    if any(without_derivatives(solution.problem.functions.called, 2)):
        return None
    return stationarity(solution, truth)


def _lost(solution: Solution, truth: ReferenceTrajectory) -> Evaluation:
    """The verdict on a trajectory that is not finite."""
    unresolved = _undefined(solution, truth) or f"not resolved in {len(truth.t) - 1} steps"
    return Evaluation(
        cost=np.inf,
        cost_error=np.inf,
        violation=np.inf,
        worst=unresolved if truth.escape is None else "the state blows up",
        stationarity=None,
        task_drift=np.inf,
        defect=np.inf,
        replay=truth.replay,
        gap=None,
        growth=None,
        resolution=truth.resolution,
        truth=truth,
    )


def _undefined(solution: Solution, truth: ReferenceTrajectory) -> str:
    """Return which function has no value where a trajectory ends; "" if none is found."""
    lost = ~np.isfinite(truth.x).all(axis=1)
    known = int(lost.argmax()) if lost.any() else len(truth.t)
    looks = np.unique(np.linspace(0, known - 1, _LOOKS).astype(int))
    t = truth.t[looks]
    fractions = (t - truth.t[0]) / (truth.t[-1] - truth.t[0])
    p = solution.data.values.at(fractions)
    return end_of_definition(solution.problem, t, truth.x[looks], solution.control(t), p)


def costates_along(solution: Solution) -> Solution:
    """Return the solution with its costates integrated backwards along its own controls.

    Any trajectory can so start an indirect method (also one of a method that knows no
    costates). Where the problem has terminal equations the final costate is the gradient of
    the terminal cost plus the part of the given costate that is normal to them.

    Args:
        solution: of any method; returned as it is where its controls make the state blow up, or
            where the dynamics are too stiff or too unstable for explicit steps in open loop.
    """
    check_instance(solution, Solution, "costates_along: solution")
    if solution.normal is not None:
        normal, form = costates_along(solution.normal), normal_form(solution.problem)
        assert form is not None
        values = normal.data.values
        costate = form.costate(normal.x, normal.costate, normal.t, normal.fractions, values)
        return solution.with_(normal=normal, costate=costate)
    truth = integrate_controls(solution)
    if not truth.has_adjoint:
        return solution
    costates, _ = adjoint(solution, truth, final_costate(solution, truth)[0])
    rows = [np.interp(solution.t, truth.t, c) for c in costates.T]
    return solution.with_(costate=np.stack(rows, axis=1))
