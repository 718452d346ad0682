"""Penalty continuation: raise the penalty of a collision until no violation remains."""

from typing import Literal

import numpy as np

from ocp import (
    OCP,
    Evaluation,
    InitialGuess,
    ProblemError,
    Solution,
    Solver,
    Status,
    Work,
    evaluate,
)
from ocp.internal import ACCURACY, check_instance, check_positive, check_whole, judged


def penalty_continuation(
    soft: OCP,
    hard: OCP,
    solver: Solver,
    *,
    parameter: str,
    factor: float = 2.0,
    tolerance: float = 1e-6,
    most: int = 30,
    guess: InitialGuess | None = None,
) -> Solution:
    """Solve a soft problem with a rising penalty until the constraint of a hard one is met.

    The program is built once. Every run starts from the same guess: from a motion through the
    obstacle a higher penalty leads to another one through it. The violation is the *referee's*,
    between the nodes too. The penalty keeps a distance, so the answer costs more than the
    optimum of the hard problem; ``AugmentedLagrangian`` finds that one.
    Source: thesis 3.3, the penalty method [Nocedal & Wright 2006, 17.1].

    Args:
        soft: the problem with a bounded cost of collision.
        hard: the same dynamics with the constraint that is to be kept.
        solver: of the soft problem.
        parameter: of the soft problem, a number that multiplies that cost.
        factor: by which it is raised.
        tolerance: on the violation of ``hard``.
        most: runs.
        guess: where every run starts.

    Returns:
        the last answer, as a solution of ``soft``; the penalty is in ``parameters``, and the
        violation of ``hard`` after every run in ``history["violation"]``. The status is the
        solver's where the constraint is met, ``INFEASIBLE`` where the last penalty leaves a
        violation, the solver's own failure where it failed.

    Raises:
        ProblemError: if the problems do not fit, or the parameter is none or not positive.
    """
    check_instance(soft, OCP, "penalty continuation: soft")
    check_instance(hard, OCP, "penalty continuation: hard")
    check_instance(solver, Solver, "penalty continuation: solver")
    check_whole(most, "penalty continuation: most")
    penalty = _first_penalty(soft, parameter)
    if (soft.model.nx, soft.model.nu) != (hard.model.nx, hard.model.nu) or not factor > 1.0:
        raise ProblemError("penalty continuation: the same model and a factor above 1 are needed")
    check_positive(tolerance, "penalty continuation: tolerance")
    if not (penalty > 0.0).all():
        raise ProblemError(
            f"penalty continuation: '{parameter}' = {penalty}, it must be positive to be raised"
        )
    program = solver.unjudged().build(soft)
    runs: list[Solution] = []
    verdicts: list[Evaluation] = []
    while len(runs) < most:
        run = program.run(parameters={parameter: penalty}, guess=guess)
        runs.append(run)
        verdicts.append(evaluate(run.with_(problem=hard, parameters={}, control_kind=_kind(run))))
        if not run.status.is_success or verdicts[-1].violation <= tolerance:
            break
        penalty = factor * penalty
    return judged(_summed(runs, verdicts, tolerance), ACCURACY)


def _first_penalty(soft: OCP, parameter: str) -> np.ndarray:
    known = {entry.name: entry for entry in soft.parameters}
    if parameter not in known:
        raise ProblemError(f"{soft.name} has no parameter '{parameter}'")
    return np.asarray(known[parameter].value, dtype=float)


def _summed(runs: list[Solution], verdicts: list[Evaluation], tolerance: float) -> Solution:
    """Return the last run with the work of all; a violation at the last penalty is infeasible."""
    last, verdict = runs[-1], verdicts[-1]
    status, message = last.status, last.message
    if status.is_success and verdict.violation > tolerance:
        status = Status.INFEASIBLE
        message = f"{verdict.worst} is violated by {verdict.violation:.3g} at the largest penalty"
    return last.with_(
        status=status,
        message=message,
        iterations=sum(run.iterations for run in runs),
        work=sum((run.work for run in runs), Work()),
        history={**last.history, "violation": np.array([v.violation for v in verdicts])},
        solve_time=sum(run.solve_time for run in runs),
    )


def _kind(run: Solution) -> Literal["held", "linear", "polynomial", "extremal"]:
    """What the controls are for another problem, whose Hamiltonian does not give them."""
    return "linear" if run.control_kind == "extremal" else run.control_kind
