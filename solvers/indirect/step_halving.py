"""By how much half the integration step would change an extremal, and half of it where needed."""

from dataclasses import dataclass, replace

import numpy as np

from ocp import Grid, Solution, Status, Work
from ocp.internal import number_of
from solvers.indirect.indirect_shooting import IndirectShootingProgram

_MOST_STEPS = 2**16
# The cost is flat about an optimum: where it holds to some accuracy, states may move by more.
_STATE = 100.0


@dataclass(frozen=True)
class HalvingChange:
    """The error of the steps, estimated by halving them.

    Attributes:
        cost: of the optimal cost, to first order.
        state: largest of the state at the end of a segment, relative to 1 + abs(x).
    """

    cost: float
    state: float


def finer(program: IndirectShootingProgram) -> IndirectShootingProgram:
    """Return the program with half the step."""
    extremals, steps = program.extremals.finer(), program.solver.steps
    steps = steps.cut(2) if isinstance(steps, Grid) else extremals.shape.segments * extremals.steps
    return IndirectShootingProgram(replace(program.solver, steps=steps), program.ocp, extremals)


def change_when_halved(
    solution: Solution, program: IndirectShootingProgram, half: IndirectShootingProgram
) -> HalvingChange:
    r"""Integrate every segment of an extremal with both programs, from the same starts.

    Halving the steps changes the cost of segment k by :math:`\Delta L_k` and the state at its
    end by :math:`\Delta x_k`. The Lagrangian of the discretised problem is stationary at its
    solution, so that the optimal cost changes, to first order, by its explicit change

    .. math:: \sum_k \Delta L_k + \lambda_k' \Delta x_k .

    Args:
        solution: an extremal that ``program`` found.
        program: with the steps it has.
        half: the same with half the step.
    """
    shape, steps = program.extremals.shape, program.extremals.steps
    z = np.hstack([solution.x, solution.costate])
    starts, ends = z[:-1:steps], z[steps::steps]
    coarse, fine = (
        each.extremals.paths(starts, each.schedule(solution.data), solution.duration)
        for each in (program, half)
    )
    x, costate = ends[:, : shape.nx], ends[:, shape.nx :]
    moved = (fine.ends - coarse.ends)[:, : shape.nx]
    return HalvingChange(
        cost=abs(float(fine.costs.sum() - coarse.costs.sum() + (costate * moved).sum())),
        state=float((np.abs(moved) / (1.0 + np.abs(x))).max()),
    )


def halved_until_still(
    result: Solution, program: IndirectShootingProgram, accuracy: float
) -> tuple[Solution, IndirectShootingProgram]:
    """Double the steps until cost and states hold still, or say by how much they do not.

    Args:
        result: an extremal that ``program`` found.
        program: with the steps it has.
        accuracy: of the cost, relative to 1 + cost; of states a hundred times that.

    Returns:
        the extremal, and the program that found it; ``INACCURATE`` beyond 65536 steps, or where
        Newton's method fails on the way.
    """
    while result.status.is_success:
        half = finer(program)
        moved = change_when_halved(result, program, half)
        result = result.with_(work=result.work + Work(rollouts=2))
        relative = moved.cost / (1.0 + abs(result.cost))
        if relative <= accuracy and moved.state <= _STATE * accuracy:
            break
        count, finer_count = (number_of(each.solver.steps) for each in (program, half))
        said = f"half of its {count} steps would change the cost by {moved.cost:.1e}"
        said = f"{said}, a state by {moved.state:.1e}"
        if finer_count > _MOST_STEPS:
            return result.with_(status=Status.INACCURATE, message=said), program
        again = joined(result, run_from(half, result))
        if not again.status.is_success:
            said = f"{said}; with {finer_count}: {again.status.name}, {again.message}"
            return result.with_(status=Status.INACCURATE, message=said), program
        result, program = again, half
    return result, program


def run_from(program: IndirectShootingProgram, guess: Solution) -> Solution:
    """Solve for the data of a solution, from it."""
    data = guess.data
    return program.run(x0=data.x0, t0=data.t0, parameters=guess.parameters, guess=guess)


def joined(first: Solution, then: Solution) -> Solution:
    """Return the second solution with the effort of both."""
    return then.with_(iterations=first.iterations + then.iterations, work=first.work + then.work)
