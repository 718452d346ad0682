"""Solvers that may hold a control over several intervals of their grid."""

from dataclasses import dataclass, field, replace
from typing import Self

from ocp.checks.arguments import check_instance
from ocp.method.scaling_solver import ScalingSolver
from ocp.problem.control_blocks import ControlBlocks, check_blocks
from ocp.problem.ocp import OCP
from ocp.solution.solver import Program


@dataclass(frozen=True)
class BlockingSolver(ScalingSolver):
    """A solver with blocks of moves, on whose intervals controls are held.

    Attributes:
        blocks: over how many intervals each control is held; the last one goes on to the end, so
            that ``(1, 1, 2)`` leaves three moves (a control horizon); none: each over one.
        blocked: names of the controls that are held in blocks, or whose rates are; None: those of
            the problem that ``build`` is given, and no slack that is put beside them.
    """

    blocks: tuple[int, ...] = field(default=(), kw_only=True)
    blocked: tuple[str, ...] | None = field(default=None, kw_only=True, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the option."""
        super().__post_init__()
        object.__setattr__(self, "blocks", check_blocks(self.blocks, type(self).__name__))
        if self.blocked is not None:
            check_instance(self.blocked, tuple, f"{type(self).__name__}: blocked")

    def build_one(self, ocp: OCP) -> Program:
        """Do all symbolic work; see ``MethodSolver.build_one``."""
        return super(BlockingSolver, self.blocking(ocp)).build_one(ocp)

    def blocking(self, ocp: OCP) -> Self:
        """Return the solver that holds the controls of a problem in blocks, and no others."""
        return self if self.blocked is not None else replace(self, blocked=ocp.model.u_names)

    def blocks_on(self, ocp: OCP, intervals: int) -> ControlBlocks | None:
        """Return the blocks on a grid of N intervals; None where there are none."""
        names = ocp.model.u_names
        own = names if self.blocked is None else self.blocked
        rated = {f"rate of {name}" for name in own}
        held = [i for i, name in enumerate(names) if name in own or name in rated]
        what = f"{ocp.name}: {type(self).__name__}"
        return ControlBlocks.of(self.blocks, intervals, held, what)
