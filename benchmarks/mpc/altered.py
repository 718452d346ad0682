"""A good solver whose answers are changed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from numpy.typing import ArrayLike

from ocp import OCP, InitialGuess, Program, Solution, Solver
from ocp.internal import ImposedRows


@dataclass(frozen=True)
class Altered(Solver):
    """A solver whose answers somebody changes, to see what becomes of it.

    Args:
        inner: the solver.
        change: (answer, t0) -> what is returned instead; it may raise.
    """

    inner: Solver
    change: Callable[[Solution, float], Solution]

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "Altered":
        """Set what is left open; see ``Solver``."""
        inner = self.inner.for_control_loop(compiled=compiled, time_limit=time_limit)
        return replace(self, inner=inner)

    def imposed(self, ocp: OCP) -> ImposedRows:
        """Return what the inner one imposes."""
        return self.inner.imposed(ocp)

    def least_violating(self, ocp: OCP) -> "AlteredProgram | None":
        """Build what the inner one does; its answers are changed as well."""
        program = self.inner.least_violating(ocp)
        return None if program is None else AlteredProgram(self, program)

    def build(self, ocp: OCP) -> "AlteredProgram":
        """Build the inner one."""
        return AlteredProgram(self, self.inner.build(ocp))


@dataclass(frozen=True, eq=False)
class AlteredProgram(Program):
    """The compiled form."""

    solver: Altered
    inner: Program

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Solve, and change the answer."""
        answer = self.inner.run(x0=x0, t0=t0, parameters=parameters, guess=guess)
        return self.solver.change(answer, t0)
