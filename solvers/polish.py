"""From a direct solution to an extremal: indirect multiple shooting, second-order test."""

from time import perf_counter
from typing import overload

from ocp import PhasesSolution, Solution, Status, UnsupportedProblem, evaluate
from ocp.internal import (
    ACCURACY,
    check_instance,
    check_positive,
    judged,
    judged_phases,
    rewriting_of,
)
from solvers.constrained.inactive_bounds import without_inactive
from solvers.direct.multiple_shooting import MultipleShooting
from solvers.indirect.indirect_shooting import IndirectShooting
from solvers.indirect.step_halving import halved_until_still, joined, run_from

SEGMENTS, STEPS = 15, 300
# Newton that fails from a held control of N intervals starts again from one of this many times N.
_FINER = 4
# But not of more: an extremal given again has steps by the thousand, which are no intervals.
_MOST_INTERVALS = 600
# Larger violations of what was left out count.
_VIOLATED = 1e-6


@overload
def polish(
    solution: Solution, *, solver: IndirectShooting | None = None, accuracy: float = 1e-8
) -> Solution: ...


@overload
def polish(
    solution: PhasesSolution, *, solver: IndirectShooting | None = None, accuracy: float = 1e-8
) -> PhasesSolution: ...


def polish(
    solution: Solution | PhasesSolution,
    *,
    solver: IndirectShooting | None = None,
    accuracy: float = 1e-8,
) -> Solution | PhasesSolution:
    """Polish a solution to an extremal, and say whether it is a minimum.

    States and costates of the solution start indirect multiple shooting; where Newton fails
    from them, it starts once more from a direct solution on a grid four times as fine, of 600
    intervals at most. The steps are doubled until the answer holds still. The extremal is
    ``SOLVED`` if the second-order test passes (no conjugate point), and stays ``STATIONARY``,
    with the reason as its message, if not.

    State bounds, path and terminal inequalities that act nowhere along the given solution are left
    out; the result is checked against them by the referee, and its message names them.

    Args:
        solution: of any method that returns costates, near an extremal; of ``Phases`` all of them
            are polished together.
        solver: segments, first number of steps, tolerance; default 15 segments, 300 steps.
        accuracy: double the steps until half of them would change the cost by less, relative
            to 1 + cost, and the state at the end of a segment by less than 100 times that,
            relative to 1 + abs(x); ``INACCURATE``, with both numbers, where 65536 steps are not
            enough, or Newton fails on the way. Iterations, work and times are those of all
            rounds.

    Raises:
        ProblemError: if an argument is of another kind, or the accuracy not positive.
        UnsupportedProblem: if the minimum principle does not apply (path constraints or state
            bounds that act, a Hamiltonian linear in the control, a cost with kinks).
    """
    check_positive(accuracy, "polish: accuracy")
    if not isinstance(solution, PhasesSolution):
        check_instance(solution, Solution, "polish: solution")
    solver = solver or IndirectShooting(segments=SEGMENTS, steps=STEPS)
    check_instance(solver, IndirectShooting, "polish: solver")
    if isinstance(solution, PhasesSolution):
        whole = polish(solution.whole, solver=solver, accuracy=accuracy)
        return judged_phases(PhasesSolution(solution.side, whole), ACCURACY)
    ocp = solution.problem
    if ocp.smoothness == 0:
        raise UnsupportedProblem(
            f"{ocp.name}: the cost has kinks (smoothness 0), no polish applies"
        )
    if (rewriting := rewriting_of(ocp)) is not None:
        polished = polish(rewriting.written(solution), accuracy=accuracy, solver=solver)
        return rewriting.answer(polished)
    reduced = without_inactive(solution)
    if reduced is None:
        return _polished(solution, solver, accuracy)
    free = solution.with_(problem=reduced.ocp)
    result = _polished(free, solver, accuracy).with_(problem=ocp)
    violation = evaluate(result).violation
    if result.status.is_success and violation > _VIOLATED:
        raise UnsupportedProblem(
            f"{ocp.name}: without {reduced.dropped} the extremal violates them by {violation:.2g}: "
            "they act, and no polish applies"
        )
    said = f"polished without {reduced.dropped}, which do not act"
    return result.with_(message="; ".join(part for part in (result.message, said) if part))


def _polished(solution: Solution, solver: IndirectShooting, accuracy: float) -> Solution:
    """Polish a solution of a problem to which the minimum principle applies."""
    started = perf_counter()
    program = solver.unjudged().prepare(solution.problem)
    built = perf_counter()
    result = run_from(program, solution)
    if not result.status.is_success:
        result = joined(result, run_from(program, _on_finer_grid(solution)))
    result, program = halved_until_still(result, program, accuracy)
    if result.status is Status.STATIONARY:
        verdict = program.second_order(result)
        status = Status.SOLVED if verdict.passed else Status.STATIONARY
        result = result.with_(status=status, message=verdict.reason)
    result = result.with_(build_time=built - started, solve_time=perf_counter() - built)
    return judged(result, ACCURACY)


def _on_finer_grid(solution: Solution) -> Solution:
    """Return the direct solution on another grid, finer if it may be, or the same one."""
    intervals = min(_FINER * (len(solution.t) - 1), _MOST_INTERVALS)
    coarse = MultipleShooting(intervals).unjudged()
    data, program = solution.data, coarse.build(solution.problem)
    finer_grid = program.run(x0=data.x0, t0=data.t0, parameters=solution.parameters, guess=solution)
    return finer_grid if finer_grid.status.is_success else solution
