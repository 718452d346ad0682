"""The elastic problem of the whole trajectory."""

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from solvers.diagnose.demands import of_box, of_constraint, of_start
from solvers.diagnose.elastic_program import Demand, ElasticProgram
from solvers.diagnose.subject import DiagnosedProblem

# Rows without slack.
_HARD = ("dynamics", "time")


@dataclass(frozen=True)
class _Row:
    """One row: its demand, its place in (g, w), its node, its bounds."""

    demand: Demand
    index: int
    node: int
    lower: float
    upper: float


def along(subject: DiagnosedProblem) -> tuple[ElasticProgram, np.ndarray]:
    """Return the demands along the whole trajectory, and the node of every row."""
    tr = subject.program.transcription
    program, bounds = tr.program, tr.bounds(subject.data)
    boxed, constrained = list(_boxed(subject)), list(_constrained(subject))
    rows = [*constrained, *boxed]
    box = (bounds["lbx"].copy(), bounds["ubx"].copy())
    relaxed = [row.index - len(tr.rows) for row in boxed]
    box[0][relaxed], box[1][relaxed] = -np.inf, np.inf
    demands = tuple(dict.fromkeys(row.demand for row in rows))
    hard = sorted(set(range(len(tr.rows))) - {row.index for row in constrained})
    elastic = ElasticProgram(
        w=program["x"],
        p=program["p"],
        hard=program["g"][hard],
        rows=ca.vertcat(program["g"], program["x"])[[row.index for row in rows]],
        lower=np.array([row.lower for row in rows]),
        upper=np.array([row.upper for row in rows]),
        owner=np.array([demands.index(row.demand) for row in rows]),
        demands=demands,
        box=box,
    )
    return elastic, np.array([row.node for row in rows])


def _boxed(subject: DiagnosedProblem) -> Iterator[_Row]:
    """Yield the bounds of states and controls at every node; a given start is not relaxed."""
    ocp, tr = subject.ocp, subject.program.transcription
    m, width, count = ocp.model, tr.nz + ocp.model.nu, len(tr.rows)
    columns = {e.element_hash(): i for i, e in enumerate(ca.vertsplit(m.x))}
    columns |= {e.element_hash(): tr.nz + i for i, e in enumerate(ca.vertsplit(m.u))}
    for demand, symbol, lower, upper in (*of_box(subject, "state"), *of_box(subject, "control")):
        column = columns[symbol.element_hash()]
        given = column < m.nx and not ocp.start_is_free[column]
        for j in range(column + width * given, tr.size, width):
            yield _Row(demand, count + j, j // width, lower, upper)
    for demand, symbol, lower, upper in of_start(subject):
        yield _Row(demand, count + columns[symbol.element_hash()], 0, lower, upper)


def _constrained(subject: DiagnosedProblem) -> Iterator[_Row]:
    """Yield the rows of the constraints that somebody wrote, in the order of the program."""
    ocp, tr = subject.ocp, subject.program.transcription
    given = {
        place: [
            demand if subject.terms.is_written(c) else None
            for c in ocp.at(place)
            for demand, *_ in of_constraint(subject, c)
        ]
        for place in ("path", "initial", "terminal")
    }
    on_control = ocp.rows.path.on_control
    late = [d for d, depends in zip(given["path"], on_control, strict=True) if not depends]
    counted: dict[tuple[str, int], int] = {}
    for i, row in enumerate(tr.rows):
        if row.place not in _HARD:
            which = counted.get((row.place, row.node), 0)
            counted[row.place, row.node] = which + 1
            here = late if row.place == "path" and row.node == tr.n else given[row.place]
            if (demand := here[which]) is not None:
                yield _Row(demand, i, row.node, row.lower, row.upper)
