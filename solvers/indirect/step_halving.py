"""By how much half the integration step would change an extremal, without solving again."""

from dataclasses import dataclass, replace

import numpy as np

from ocp import Solution
from solvers.indirect.indirect_shooting import IndirectShootingProgram


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
    extremals = program.extremals.finer()
    steps = extremals.shape.segments * extremals.steps
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
