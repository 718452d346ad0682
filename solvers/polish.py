"""A direct solution made exact: indirect multiple shooting, then the second-order test."""

from dataclasses import replace
from time import perf_counter

from ocp import Solution, Status, UnsupportedProblem
from solvers.indirect_shooting import IndirectShooting

SEGMENTS, STEPS = 15, 300
_MOST_STEPS = 2**16


def polish(
    solution: Solution, *, solver: IndirectShooting | None = None, accuracy: float | None = None
) -> Solution:
    """Polish a solution to an extremal, and say whether it is a minimum.

    States and costates of the solution start indirect multiple shooting; the extremal is
    ``SOLVED`` if the second-order test passes (no conjugate point), and stays
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
    if solution.problem.smoothness == 0:
        name = solution.problem.name
        raise UnsupportedProblem(f"{name}: the cost has kinks (smoothness 0), no polish applies")
    solver = solver or IndirectShooting(segments=SEGMENTS, steps=STEPS)
    result = _polish_once(solution, solver)
    while accuracy is not None and result.status.is_success and 2 * solver.steps <= _MOST_STEPS:
        solver = replace(solver, steps=2 * solver.steps)
        finer = _polish_once(result, solver)
        change = abs(finer.cost - result.cost)
        result = finer.with_(
            iterations=result.iterations + finer.iterations,
            work=result.work + finer.work,
            build_time=result.build_time + finer.build_time,
            solve_time=result.solve_time + finer.solve_time,
        )
        if change <= accuracy * (1.0 + abs(finer.cost)):
            break
    return result


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
