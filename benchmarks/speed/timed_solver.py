"""``Timed``: a solver whose runs are timed, in the order in which they are made."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from time import perf_counter

from numpy.typing import ArrayLike

from ocp import OCP, InitialGuess, Program, Solution, Solver
from solvers.internal import MultipleShootingProgram


@dataclass(frozen=True, eq=False)
class Timed(Solver):
    """A solver around another one.

    Attributes:
        inner: the other one.
        times: of its runs [s].
        in_c: of these what the native backend took by its own clock [s]; empty for other backends.
    """

    inner: Solver
    times: list[float] = field(default_factory=list)
    in_c: list[float] = field(default_factory=list)

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "Timed":
        """Set what is left open; see ``Solver``."""
        inner = self.inner.for_control_loop(compiled=compiled, time_limit=time_limit)
        return replace(self, inner=inner)

    def build(self, ocp: OCP) -> "TimedProgram":
        """Build the other one; see ``Solver``."""
        return TimedProgram(self.inner.build(ocp), self)


@dataclass(frozen=True, eq=False)
class TimedProgram(Program):
    """A program around another one, with the lists of its solver."""

    inner: Program
    solver: Timed

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Run the other one; see ``Program``."""
        started = perf_counter()
        found = self.inner.run(x0=x0, t0=t0, parameters=parameters, guess=guess)
        self.solver.times.append(perf_counter() - started)
        if isinstance(self.inner, MultipleShootingProgram) and self.inner.seconds_in_c is not None:
            self.solver.in_c.append(self.inner.seconds_in_c)
        return found
