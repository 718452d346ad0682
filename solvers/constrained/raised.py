"""The loop that thesis 3.3 sketches: raise the price of a collision until nobody pays it."""

from typing import Literal

import numpy as np

from ocp import (
    OCP,
    ProblemError,
    Solution,
    Solver,
    Start,
    Status,
    Work,
    evaluate,
    instance,
    whole,
)


def raise_until_clear(
    soft: OCP,
    hard: OCP,
    solver: Solver,
    *,
    parameter: str,
    factor: float = 2.0,
    tolerance: float = 1e-6,
    most: int = 30,
    guess: Start | None = None,
) -> Solution:
    """Solve a soft problem again and again, its price raised until a hard one is kept.

    The program is built once. Every run starts from the same guess: from a motion through the
    obstacle a higher price leads to another one through it. Clear is what the *referee* finds
    clear, between the nodes too. The price buys distance, so the answer costs
    more than the optimum of the hard problem; ``AugmentedLagrangian`` finds that one.
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
        the last answer, as a solution of ``soft``; the price is in ``parameters``, and the
        violation of ``hard`` after every run in ``history["violation"]``. The status is the
        solver's where the answer is clear, ``INFEASIBLE`` where even the last price was paid,
        the solver's own failure where it failed.

    Raises:
        ProblemError: if the problems do not fit, or the parameter is none or not positive.
    """
    instance(solver, Solver, "raise until clear: solver")
    whole(most, "raise until clear: most")
    known = {entry.name: entry for entry in soft.parameters}
    if parameter not in known:
        raise ProblemError(f"{soft.name} has no parameter '{parameter}'")
    if (soft.model.nx, soft.model.nu) != (hard.model.nx, hard.model.nu) or not factor > 1.0:
        raise ProblemError("raise until clear: the same model and a factor above 1 are needed")
    price = np.asarray(known[parameter].value, dtype=float)
    if not (tolerance > 0.0 and (price > 0.0).all()):
        raise ProblemError(
            f"raise until clear: tolerance = {tolerance} and '{parameter}' = {price} must be "
            "positive, or nothing can be raised until anything is clear"
        )
    program = solver.build(soft)
    runs: list[Solution] = []
    violations: list[float] = []
    worst = ""
    while len(runs) < most:
        run = program.run(parameters={parameter: price}, guess=guess)
        verdict = evaluate(run.with_(problem=hard, parameters={}, control_kind=_kind(run)))
        runs, violations = [*runs, run], [*violations, verdict.violation]
        worst = verdict.worst
        if not run.status.is_success or verdict.violation <= tolerance:
            break
        price = factor * price
    last, status, message = runs[-1], runs[-1].status, runs[-1].message
    if status.is_success and violations[-1] > tolerance:
        status = Status.INFEASIBLE
        message = f"{worst} is violated by {violations[-1]:.3g} at any price"
    return last.with_(
        status=status,
        message=message,
        iterations=sum(run.iterations for run in runs),
        work=sum((run.work for run in runs), Work()),
        history={**last.history, "violation": np.array(violations)},
        solve_time=sum(run.solve_time for run in runs),
    )


def _kind(run: Solution) -> Literal["held", "linear", "polynomial", "extremal"]:
    """What the controls are for another problem, whose Hamiltonian does not give them."""
    return "linear" if run.control_kind == "extremal" else run.control_kind
