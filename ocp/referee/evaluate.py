"""The referee: what a solution's controls really cost, violate and leave unoptimised."""

from dataclasses import dataclass

import numpy as np

from ocp.checks.arguments import check_instance, check_positive
from ocp.referee.reference_trajectory import ReferenceTrajectory, adjoint, integrate_controls
from ocp.referee.stationarity import final_costate, stationarity
from ocp.referee.violation import invariant_drift, largest_violation
from ocp.solution.solution import Solution


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The verdict on a solution.

    Attributes:
        cost: true cost, inf if the controls make the state blow up.
        cost_error: change of the cost under the last halving of the steps.
        violation: largest violation of any bound or constraint, between the nodes too.
        worst: which one, and when; empty where nothing is violated.
        stationarity: residual of the minimum principle, max over time of
            abs(u - clip(u - H_u)) with the referee's own costates, for a held control
            averaged over its interval, for a polynomial one by its coefficients, and of
            transversality at free ends; None where a path constraint or state bound is active
            (its multiplier would be needed).
        task_drift: largest violation of the problem's invariants.
        defect: largest distance of the solution's states from the true ones at its nodes.
        truth: the trajectory itself.
    """

    cost: float
    cost_error: float
    violation: float
    worst: str
    stationarity: float | None
    task_drift: float
    defect: float
    truth: ReferenceTrajectory


def evaluate(solution: Solution, *, tolerance: float = 1e-9) -> Evaluation:
    """Judge a solution by integrating its controls, whatever its solver says.

    Args:
        solution: of any solver, with controls of any kind.
        tolerance: the cost is refined until halving the steps changes it by less, relative.

    Returns:
        the verdict; nothing is raised for a bad trajectory, its numbers are bad.

    Raises:
        ProblemError: if it is no solution, or the tolerance not positive.
    """
    check_instance(solution, Solution, "evaluate: solution")
    check_positive(tolerance, "evaluate: tolerance")
    truth = integrate_controls(solution, tolerance=tolerance)
    if not truth.is_finite:
        return Evaluation(
            cost=np.inf,
            cost_error=np.inf,
            violation=np.inf,
            worst="the state blows up",
            stationarity=None,
            task_drift=np.inf,
            defect=np.inf,
            truth=truth,
        )
    violation = largest_violation(solution, truth)
    own = np.stack([np.interp(solution.t, truth.t, c) for c in truth.x.T], axis=1)
    return Evaluation(
        cost=truth.cost,
        cost_error=truth.cost_error,
        violation=violation.amount,
        worst=violation.where if violation.amount > 0.0 else "",
        stationarity=stationarity(solution, truth),
        task_drift=invariant_drift(solution, truth),
        defect=float(np.abs(own - solution.x).max()),
        truth=truth,
    )


def costates_along(solution: Solution) -> Solution:
    """Return the solution with its costates integrated backwards along its own controls.

    Any trajectory can so start an indirect method (also one of a method that knows no
    costates). Where the problem has terminal equations the final costate is the gradient of
    the terminal cost plus the part of the given costate that is normal to them.

    Args:
        solution: of any method; returned as it is where its controls make the state blow up.
    """
    check_instance(solution, Solution, "costates_along: solution")
    truth = integrate_controls(solution)
    if not truth.is_finite:
        return solution
    costates, _ = adjoint(solution, truth, final_costate(solution, truth)[0])
    rows = [np.interp(solution.t, truth.t, c) for c in costates.T]
    return solution.with_(costate=np.stack(rows, axis=1))
