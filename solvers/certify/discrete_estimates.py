"""The optimal value of a discrete-time problem by independent methods."""

from ocp import Solution, Solver, UnsupportedProblem, evaluate
from solvers.certify.certificate import Estimate
from solvers.certify.estimates import TOLERANCE, NoEstimateError
from solvers.direct.multiple_shooting import MultipleShooting
from solvers.linear.linear_mpc import LinearMPC
from solvers.linear.riccati import Riccati

# Of the nonlinear program: there is no grid that could be refined, only this.
_BARRIER = 1e-11


def by_nonlinear_program(solution: Solution) -> Estimate:
    """Return the value of the nonlinear program, which is the problem itself.

    Raises:
        NoEstimateError: if it is not solved.
    """
    return _estimate(MultipleShooting(tolerance=_BARRIER), "nonlinear program", solution)


def by_linear_method(solution: Solution) -> Estimate:
    """Return the value of the Riccati recursion, or of a quadratic program where bounds are.

    Raises:
        NoEstimateError: if the problem is not linear-quadratic, or not solved.
    """
    try:
        return _estimate(Riccati(), "Riccati recursion", solution)
    except UnsupportedProblem:
        pass
    try:
        return _estimate(LinearMPC(), "quadratic program", solution)
    except UnsupportedProblem as reason:
        raise NoEstimateError(str(reason)) from None


def _estimate(solver: Solver, name: str, start: Solution) -> Estimate:
    data = start.data
    answer = solver.build(start.problem).run(
        x0=data.x0, t0=data.t0, parameters=start.parameters, guess=start
    )
    if not answer.status.is_success:
        raise NoEstimateError(f"{name}: {answer.status.value}. {answer.message}")
    verdict = evaluate(answer, tolerance=TOLERANCE)
    apart = abs(verdict.cost - answer.cost)
    return Estimate(
        method=name,
        cost=verdict.cost,
        error=max(apart, verdict.cost_error, verdict.violation),
        violation=verdict.violation,
        solution=answer,
        sentence=f"the referee's cost differs by {apart:.1e}",
    )
