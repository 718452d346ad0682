"""A direct solution made exact: indirect multiple shooting, then the second-order test."""

from time import perf_counter

from ocp import Solution, Status, UnsupportedProblem
from solvers.indirect_shooting import IndirectShooting

SEGMENTS, STEPS = 15, 300


def polish(solution: Solution, *, solver: IndirectShooting | None = None) -> Solution:
    """Polish a solution to an extremal, and say whether it is a minimum.

    States and costates of the solution start indirect multiple shooting; the extremal is
    ``SOLVED`` if the second-order test passes (no conjugate point), and stays
    ``STATIONARY``, with the reason as its message, if not.

    Args:
        solution: of any method that returns costates, near an extremal.
        solver: segments, steps and tolerance; default 15 segments, 300 steps.

    Raises:
        UnsupportedProblem: if the minimum principle does not apply (path constraints, state
            bounds, a Hamiltonian linear in the control, a cost with kinks).
    """
    ocp = solution.problem
    if ocp.smoothness == 0:
        raise UnsupportedProblem(
            f"{ocp.name}: the cost has kinks (smoothness 0), no polish applies"
        )
    started = perf_counter()
    program = (solver or IndirectShooting(segments=SEGMENTS, steps=STEPS)).build(ocp)
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
