"""A solution of phases: one of each, with what couples them."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ocp.checks.arguments import check_instance
from ocp.checks.errors import SolverError
from ocp.checks.rich_text import html_of
from ocp.phases.chain import Chain
from ocp.phases.phases_evaluation import PhasesEvaluation, evaluate_phases
from ocp.phases.side_by_side import SideBySide, side_by_side
from ocp.phases.way_back import begun, phase_solutions
from ocp.plotting.plot_method import Plottable
from ocp.plotting.plottable import Pictured
from ocp.problem.portable import without_caches
from ocp.solution.composite import CompositeSolution
from ocp.solution.solution import Solution
from ocp.solution.status import Status


@dataclass(frozen=True, eq=False)
class PhasesSolution(CompositeSolution[PhasesEvaluation], Plottable):
    """What a solver returns for ``Phases``.

    Attributes:
        side: the phases side by side.
        whole: their solution as one problem on [0, 1], see ``SideBySide``; its message speaks of
            phases.
    """

    side: SideBySide
    whole: Solution

    _called: ClassVar[str] = "a solution of phases"

    @property
    def problem(self) -> Chain:
        """What was solved."""
        return self.side.chain

    @property
    def status(self) -> Status:
        """How the solve ended."""
        return self.whole.status

    @property
    def message(self) -> str:
        """What, in which phase and when, where the status alone does not say it."""
        return self.whole.message

    @property
    def solver(self) -> str:
        """The solver, as text."""
        return self.whole.solver

    @property
    def cost(self) -> float:
        """Of all phases, as the solver computes it; ``evaluate`` integrates it independently."""
        return self.whole.cost

    @property
    def iterations(self) -> int:
        """Iterations of the method."""
        return self.whole.iterations

    @property
    def build_time(self) -> float:
        """Time of ``build`` [s]."""
        return self.whole.build_time

    @property
    def solve_time(self) -> float:
        """Time of the method in ``run`` [s]."""
        return self.whole.solve_time

    @cached_property
    def phases(self) -> tuple[Solution, ...]:
        """The solution of each phase, on its own clock; its cost is the referee's."""
        return phase_solutions(self.side, self.whole)

    @property
    def durations(self) -> np.ndarray:
        """Durations of the phases [s]."""
        return self.side.durations(self.whole.unknowns)

    @property
    def t(self) -> np.ndarray:
        """When each phase starts, and when the last one ends [s]."""
        return begun(self.side, self.whole)

    @property
    def unknowns(self) -> dict[str, np.ndarray]:
        """Values of the unknown constants of all phases, by name."""
        return {u.name: self.whole.unknowns[u.name] for u in self.problem.unknowns}

    @property
    def sensitivity(self) -> dict[str, np.ndarray]:
        """dJ*/dk of every one: 0 inside its bounds, on a bound what that costs."""
        found = self.whole.sensitivity
        return {u.name: found[u.name] for u in self.problem.unknowns}

    @property
    def jumps(self) -> tuple[dict[str, float], ...]:
        """By how much costates jump at every link, by name of the states that both phases have."""
        found = []
        for coupling in self.problem.couplings:
            before, after = (self.phases[i] for i in (coupling.before, coupling.after))
            ends, starts = (
                dict(zip(s.problem.model.x_names, costate, strict=True))
                for s, costate in ((before, before.costate[-1]), (after, after.costate[0]))
            )
            both = [name for name in starts if name in ends]
            found.append({name: float(starts[name] - ends[name]) for name in both})
        return tuple(found)

    def __getitem__(self, name: str) -> Solution:
        """Return the solution of a phase by its name."""
        return self.phases[self.problem.names.index(name)]

    def __repr__(self) -> str:
        """Return one line: what was solved, how it ended, the cost as the solver computes it."""
        each = zip(self.problem.names, self.durations, strict=True)
        said = ", ".join(f"{name} {duration:.4g} s" for name, duration in each)
        return (
            f"<Solution of '{self.problem.name}' ({said}): {self.status.name}, "
            f"cost {self.cost:.6g}, {self.iterations} iterations>"
        )

    def _repr_html_(self) -> str:
        """Return what was found in numbers, for a notebook."""
        each = zip(self.problem.names, self.durations, strict=True)
        facts = [
            ("status", self.status.words),
            ("message", self.message or "-"),
            ("cost, the solver's own", f"{self.cost:.9g}"),
            *((f"duration of {name} [s]", f"{duration:.6g}") for name, duration in each),
            ("solver", self.solver),
        ]
        return html_of(f"Solution of {self.problem.name}", facts=facts)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is copied and pickled: the fields."""
        return without_caches(self)

    def or_raise(self) -> "PhasesSolution":
        """Return self, or raise ``SolverError`` with the reason if the solve failed."""
        if not self.status.is_success:
            said = f"{self.solver}: {self.status.value}. {self.message}".strip()
            raise SolverError(said, self.whole)
        return self

    def with_(self, **changes: Any) -> "PhasesSolution":
        """Return a copy with some fields of ``whole`` replaced, such as status and message."""
        return replace(self, whole=self.whole.with_(**changes))

    @property
    def _pictured(self) -> Pictured:
        """What a picture says of it."""
        problem = self.problem
        return Pictured(
            problem.name,
            self.status,
            self.message,
            self.cost,
            self.unknowns,
            self.phases,
            problem.names,
        )

    def save(self, path: str | Path) -> Path:
        """Write everything to one ``.npz`` file; return its path. See ``Solution.save``."""
        return self.whole.save(path)

    @classmethod
    def load(cls, path: str | Path, problem: Chain) -> "PhasesSolution":
        """Read a solution of ``Phases`` from a file that ``save`` wrote.

        Raises:
            ProblemError: if the file cannot be read, or belongs to another problem.
            DamagedFile: if it is no solution, or not as it was saved.
        """
        check_instance(problem, Chain, f"the phases that {path} is to be a solution of")
        side = side_by_side(problem)
        return cls(side, Solution.load(path, side.problem))

    def evaluated(self, tolerance: float) -> PhasesEvaluation:
        """Return the referee's verdict; see ``evaluate``."""
        return evaluate_phases(self.side, self.whole, self.phases, tolerance)
