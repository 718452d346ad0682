"""A direct solution made exact: indirect multiple shooting, then the second-order test."""

from dataclasses import replace
from time import perf_counter

from ocp import Solution, Status, UnsupportedProblem
from solvers.direct.multiple_shooting import MultipleShooting
from solvers.indirect.indirect_shooting import IndirectShooting

SEGMENTS, STEPS = 15, 300
_MOST_STEPS = 2**16
# Newton that fails from a held control of N intervals starts again from one of this many times N.
_FINER = 4


def polish(
    solution: Solution, *, solver: IndirectShooting | None = None, accuracy: float | None = None
) -> Solution:
    """Polish a solution to an extremal, and say whether it is a minimum.

    States and costates of the solution start indirect multiple shooting; where Newton fails
    from them, it starts once more from a direct solution on a grid four times as fine. The
    extremal is ``SOLVED`` if the second-order test passes (no conjugate point), and stays
    ``STATIONARY``, with the reason as its message, if not.

    Args:
        solution: of any method that returns costates, near an extremal.
        solver: segments, steps and tolerance; default 15 segments, 300 steps.
        accuracy: double the steps until the cost changes by less, relative to 1 + cost;
            None: keep the solver's steps. Iterations, work and times are those of all rounds.

    Raises:
        UnsupportedProblem: if the minimum principle does not apply (path constraints, state
            bounds, a Hamiltonian linear in the control, a cost with kinks).
    """
    ocp = solution.problem
    if ocp.smoothness == 0:
        raise UnsupportedProblem(
            f"{ocp.name}: the cost has kinks (smoothness 0), no polish applies"
        )
    solver = solver or IndirectShooting(segments=SEGMENTS, steps=STEPS)
    result = _polish_once(solution, solver)
    if not result.status.is_success:
        result = _joined(result, _polish_once(_finer(solution), solver))
    return result if accuracy is None else _refined(result, solver, accuracy)


def _refined(result: Solution, solver: IndirectShooting, accuracy: float) -> Solution:
    """Double the steps until the cost holds still."""
    while result.status.is_success:
        if 2 * solver.steps > _MOST_STEPS:
            reason = f"the cost still changes by more than {accuracy:g} at {solver.steps} steps"
            return result.with_(status=Status.INACCURATE, message=reason)
        solver = replace(solver, steps=2 * solver.steps)
        finer = _polish_once(result, solver)
        change = abs(finer.cost - result.cost)
        result = _joined(result, finer)
        if change <= accuracy * (1.0 + abs(finer.cost)):
            break
    return result


def _finer(solution: Solution) -> Solution:
    """Return the direct solution on a finer grid, or the same one if there is none."""
    data, intervals = solution.data, _FINER * (len(solution.t) - 1)
    program = MultipleShooting(intervals).build(solution.problem)
    finer = program.run(x0=data.x0, t0=data.t0, parameters=solution.parameters, guess=solution)
    return finer if finer.status.is_success else solution


def _polish_once(solution: Solution, solver: IndirectShooting) -> Solution:
    started = perf_counter()
    program = solver.build(solution.problem)
    build_time = perf_counter() - started
    data = solution.data
    result = program.run(
        x0=data.x0, t0=data.t0, parameters=solution.parameters, guess=solution
    ).with_(build_time=build_time)
    if result.status is not Status.STATIONARY:
        return result
    verdict = program.second_order(result)
    status = Status.SOLVED if verdict.passed else Status.STATIONARY
    return result.with_(status=status, message=verdict.reason)


def _joined(first: Solution, then: Solution) -> Solution:
    """Return the second solution with the effort of both."""
    return then.with_(
        iterations=first.iterations + then.iterations,
        work=first.work + then.work,
        build_time=first.build_time + then.build_time,
        solve_time=first.solve_time + then.solve_time,
    )
