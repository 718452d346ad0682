"""Phases prepared by a solver: one program for all of them side by side."""

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.errors import ProblemError
from ocp.phases.judged_phases import judged_phases
from ocp.phases.phases_guess import PhasesGuess, checked_guess, guess_of_all, start_of
from ocp.phases.phases_solution import PhasesSolution
from ocp.phases.side_by_side import SideBySide
from ocp.problem.run_data import RunData
from ocp.solution.composite import CompositeProgram
from ocp.solution.solver import Program


@dataclass(frozen=True, eq=False)
class PhasesProgram(CompositeProgram[PhasesSolution]):
    """A program for phases.

    Attributes:
        side: the phases side by side.
        program: solves the one problem, and judges nothing.
        accuracy: of a success, see ``judged_phases``; inf: nothing is compared.
        slack: of ends, see ``judged_phases``.
    """

    side: SideBySide
    program: Program
    accuracy: float
    slack: float

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: PhasesGuess | None = None,
    ) -> PhasesSolution:
        """Solve for these data.

        Args:
            x0: start of the first phase (nx,), a guess of it where that is free or linked.
            t0: initial time of the first phase [s].
            parameters: values by name; one goes to every phase that has a parameter of that name.
                Signals run over the phase that has them.
            guess: a ``PhasesSolution``, or a sequence with a ``Guess``, a ``Solution`` or None for
                each phase; without one the phases' own guesses.

        Returns:
            a solution whose ``status`` says how it ended; failure is no exception.

        Raises:
            ProblemError: if the data do not fit the phases.
        """
        started, side = perf_counter(), self.side
        first = checked_guess(side.chain, guess)
        data = self._data(x0, t0, parameters)
        found = self.program.run(
            x0=np.concatenate([start_of(*each) for each in zip(side.lanes, data, strict=True)]),
            parameters=side.parameters(parameters, t0),
            guess=guess_of_all(side, first, data),
        )
        seconds = perf_counter() - started
        answer = PhasesSolution(side, found.with_(solve_time=seconds))
        return judged_phases(answer, self.accuracy, self.slack)

    def _data(
        self, x0: ArrayLike | None, t0: float, parameters: Mapping[str, ArrayLike] | None
    ) -> list[RunData]:
        """Return the numbers of each phase, checked; later ones start when the guess says so."""
        chain, given = self.side.chain, dict(parameters or {})
        known = {entry.name for phase in chain.phases for entry in phase.given}
        shared = {unknown.name for unknown in chain.unknowns}
        for name in given:
            if name in shared:
                raise ProblemError(
                    f"{chain.name}: '{name}' is an unknown constant, which the optimiser chooses"
                )
            if name not in known:
                declared = ", ".join(sorted(known - shared)) or "none"
                raise ProblemError(
                    f"{chain.name}: no phase has a parameter '{name}'; declared are: {declared}"
                )
        found, start = [], t0
        for phase in chain.phases:
            own = {e.name: given[e.name] for e in phase.given if e.name in given}
            found.append(RunData.of(phase, None if found else x0, start, own))
            start += phase.duration
        return found
