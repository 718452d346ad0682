"""Collocation on a mesh that is refined until the dynamics are met between the points."""

from dataclasses import dataclass, replace
from math import ceil
from time import perf_counter
from typing import Any

import numpy as np

from ocp import Interrupted, Progress, Solution, Status, Work
from ocp.internal import (
    ACCURACY,
    check_instance,
    check_positive,
    check_whole,
    judged,
    rewriting_of,
    told,
)
from solvers.collocation.collocation import Collocation
from solvers.collocation.collocation_points import HIGHEST, LOWEST
from solvers.collocation.mesh import Mesh

# One more degree has to divide the error of an interval by this, or the interval is split.
_PAYS = 5.0
# Into how many parts at most an interval is split at once.
_MOST_PARTS = 4
# Intervals shorter than this fraction of the horizon are left as they are.
_SHORTEST = 1e-5


@dataclass(frozen=True, eq=False)
class MeshRound:
    """One mesh and what came of it.

    Attributes:
        mesh: the mesh.
        errors: of each interval: by how much the dynamics, integrated from node to node, miss
            the polynomial, or the running cost its quadrature, see ``Defects.errors``, (K,).
        solution: of this round alone.
    """

    mesh: Mesh
    errors: np.ndarray
    solution: Solution

    @property
    def cost(self) -> float:
        """The solver's own cost."""
        return self.solution.cost

    @property
    def status(self) -> Status:
        """How the solve ended."""
        return self.solution.status

    @property
    def error(self) -> float:
        """The largest error of any interval."""
        return float(self.errors.max())


@dataclass(frozen=True, eq=False)
class MeshRefinement:
    """A refined solution and how it came about.

    Attributes:
        solution: of the best round: the last that was solved, successful where every interval
            meets the accuracy; the start where no round was solved and the start was. Work,
            iterations and times are those of all rounds.
        rounds: the meshes, in order, each with its solution.
    """

    solution: Solution
    rounds: tuple[MeshRound, ...]

    def __repr__(self) -> str:
        """Return one line: how many rounds, and how far."""
        error = f"{self.rounds[-1].error:.1e}" if self.rounds else "none"
        status = self.solution.status.name
        return f"<MeshRefinement: {len(self.rounds)} rounds, {status}, last error {error}>"


def refine_mesh(
    start: Solution,
    *,
    solver: Collocation | None = None,
    accuracy: float = 1e-8,
    rounds: int = 20,
    progress: Progress | None = None,
) -> MeshRefinement:
    """Collocate again and again, on finer intervals or with higher degrees where it is needed.

    In every round dynamics and running cost are integrated from node to node under the
    solution's own controls.
    An interval whose error exceeds the accuracy gets one degree more, up to 5, as long as that
    pays (the error falls to a fifth: the solution is smooth there); otherwise it is split, in as
    many parts as its order makes necessary, 2 to 4. Nothing is ever coarsened, no number is
    drawn. The idea is that of [Patterson, Hager & Rao 2015].

    It sees what dynamics and running cost see. A kink of the control that both integrate
    exactly, such as the switch of a double integrator in minimum time, leaves no error and is
    not refined; neither is a control that is merely not optimal between the points, or
    violates a constraint there. ``evaluate`` shows all three.

    Args:
        start: a solution of any solver: the problem, its data, and the first guess.
        solver: points, options, and the first mesh; default ``Collocation(intervals=10)``.
        accuracy: accepted error of an interval, see ``MeshRound``.
        rounds: meshes at most; ``INACCURATE`` if the last is still not fine enough.
        progress: told after each round how many are done, of how many at most, and the error.

    Returns:
        the best solution and all rounds. A round that fails ends it; its reason stands in the
        message. An answer that was solved is never returned as anything worse than ``INACCURATE``.

    Raises:
        ProblemError: if an option is wrong.
        UnsupportedProblem: for a discrete-time model.
        Interrupted: on Ctrl-C; its ``so_far`` are the rounds that were done.
    """
    report = told(progress, "refine_mesh")
    check_whole(rounds, "refine_mesh: rounds")
    check_positive(accuracy, "refine_mesh: accuracy")
    check_instance(start, Solution, "refine_mesh: start")
    solver = solver or Collocation(intervals=10)
    check_instance(solver, Collocation, "refine_mesh: solver")
    if (rewriting := rewriting_of(start.problem)) is not None:
        written = rewriting.written(start)
        options: Any = {"accuracy": accuracy, "rounds": rounds, "progress": progress}
        found = refine_mesh(written, solver=solver, **options)
        return replace(found, solution=rewriting.answer(found.solution))
    done: list[MeshRound] = []
    try:
        made = _refined(start, solver, accuracy, rounds, done, report)
    except KeyboardInterrupt:
        raise Interrupted("refine_mesh", tuple(done)) from None
    totals: dict[str, Any] = {
        "work": sum((each.solution.work for each in done), Work()),
        "iterations": sum(each.solution.iterations for each in done),
        "solve_time": sum(each.solution.solve_time for each in done),
    }
    best = _best(start, done, accuracy).with_(build_time=made, **totals)
    return MeshRefinement(judged(best, ACCURACY), tuple(done))


def _refined(
    start: Solution,
    solver: Collocation,
    accuracy: float,
    rounds: int,
    done: list[MeshRound],
    report: Progress,
) -> float:
    """Add round after round to ``done``; return the time of all symbolic work [s]."""
    cells, solution, made = _Cells.of(solver.mesh_of(start.problem)), start, 0.0
    for k in range(rounds):
        begun = perf_counter()
        program = replace(solver, mesh=cells.mesh, accuracy=np.inf).prepare(start.problem)
        made += perf_counter() - begun
        data = start.data
        solution = program.run(x0=data.x0, t0=data.t0, parameters=start.parameters, guess=solution)
        errors = program.defects.errors(solution)
        done.append(MeshRound(cells.mesh, errors, solution))
        finished = not solution.status.is_success or done[-1].error <= accuracy
        said = f"error {done[-1].error:.1e} on {len(errors)} intervals"
        report(k + 1, k + 1 if finished else rounds, said)
        if finished:
            break
        cells = cells.finer(errors, accuracy)
    return made


def _best(start: Solution, done: list[MeshRound], accuracy: float) -> Solution:
    """Return the last round that was solved, with what is to be said of it."""
    last = done[-1]
    failure = f"mesh {len(done)} ended with {last.status.name}. {last.solution.message}".strip()
    solved = [each for each in done if each.status.is_success]
    if not solved and start.status.is_success:
        said = f"the start itself, since no mesh was solved: {failure}"
        return start.with_(message=said)
    if not solved:
        return last.solution
    best = solved[-1]
    if best.error <= accuracy:
        return best.solution
    said = f"an interval is still wrong by {best.error:.2g} after {len(done)} meshes"
    if best is not last:
        said = f"{said}; {failure}"
    return best.solution.with_(status=Status.INACCURATE, message=said)


@dataclass(frozen=True)
class _Cells:
    """A mesh that remembers what its last raises of a degree were worth.

    Attributes:
        mesh: the mesh.
        before: error of each interval when it had one degree less; None where it was not raised.
    """

    mesh: Mesh
    before: tuple[float | None, ...]

    @classmethod
    def of(cls, mesh: Mesh) -> "_Cells":
        return cls(mesh, (None,) * mesh.intervals)

    def finer(self, errors: np.ndarray, accuracy: float) -> "_Cells":
        """Return the next mesh."""
        edges, degrees, before = [0.0], [], []
        ends = zip(self.mesh.edges, self.mesh.edges[1:], strict=False)
        for (left, right), degree, error, was in zip(
            ends, self.mesh.degrees, errors.tolist(), self.before, strict=True
        ):
            parts, new = 1, degree
            smooth = was is None or was >= _PAYS * error
            needed = not error <= accuracy and right - left > _SHORTEST
            if needed and smooth and degree < HIGHEST:
                new = degree + 1
            elif needed:
                parts = _parts(error / accuracy, degree)
                new = degree if smooth else max(LOWEST, degree - 1)
            edges += np.linspace(left, right, parts + 1)[1:].tolist()
            degrees += [new] * parts
            before += [error if new > degree else None] * parts
        return _Cells(Mesh(tuple(edges), tuple(degrees)), tuple(before))


def _parts(excess: float, degree: int) -> int:
    """Return how many parts divide an error of order degree + 1 by enough."""
    if not np.isfinite(excess):
        return _MOST_PARTS
    return int(np.clip(ceil(excess ** (1.0 / (degree + 1))), 2, _MOST_PARTS))
