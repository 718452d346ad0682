"""The demands of a problem: at one instant, and along the whole trajectory."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp import Box, Constraint
from solvers.diagnose.elastic import Demand, Elastic
from solvers.diagnose.graph import appearing
from solvers.diagnose.subject import Subject

# Rows that hold whatever else gives way.
_HARD = ("dynamics", "time")

Asked = tuple[Demand, ca.SX, float, float]


def size(*numbers: float) -> float:
    """Return how large a demand is: its largest finite number, or 1."""
    finite = [abs(v) for v in numbers if np.isfinite(v) and v != 0.0]
    return max(finite, default=1.0)


def of_box(subject: Subject, kind: str) -> Iterator[Asked]:
    """Yield every finite bound of ``"state"`` or ``"control"``, each side for itself."""
    ocp, m = subject.ocp, subject.ocp.model
    is_control = kind == "control"
    box, symbols = (ocp.control_bounds, m.u) if is_control else (ocp.state_bounds, m.x)
    names = m.u_names if is_control else m.x_names
    for i, name in enumerate(names):
        yield from _sides(subject, box, i, name, symbols[i], is_control)


def _sides(
    subject: Subject, box: Box, i: int, name: str, symbol: ca.SX, is_control: bool
) -> Iterator[Asked]:
    lower, upper = float(np.asarray(box.lower)[i]), float(np.asarray(box.upper)[i])
    for side, low, high in (("lower", lower, np.inf), ("upper", -np.inf, upper)):
        number = low if side == "lower" else high
        if np.isfinite(number):
            label = f"the {side} bound {number:g} of {name}"
            demand = Demand((name,), label, subject.unit(name), size(lower, upper), is_control)
            yield demand, symbol, low, high


def of_constraint(subject: Subject, c: Constraint) -> Iterator[Asked]:
    """Yield every row of a constraint."""
    for i, (row, low, high) in enumerate(
        zip(ca.vertsplit(c.expression), np.asarray(c.lower), np.asarray(c.upper), strict=True)
    ):
        names = appearing(subject.ocp, row)
        which = f" (row {i}, {names[0] if len(names) == 1 else 'several'})" if c.size > 1 else ""
        unit = subject.unit(names[0]) if row.is_symbolic() else ""
        where = (c.name, *names) if row.is_symbolic() else (c.name,)
        label = f"the {c.at} constraint '{c.name}'{which}"
        yield (
            Demand(where, label, unit, size(float(low), float(high))),
            row,
            float(low),
            float(high),
        )


def at_instant(subject: Subject, asked: list[Asked], t: float, fraction: float) -> Elastic:
    """Return the demands on (x, u) at one instant; x0 is not fixed."""
    ocp, m = subject.ocp, subject.ocp.model
    stacked = ca.vertcat(*[row for _, row, _, _ in asked])
    function = ca.Function("rows", [ca.vertcat(m.x, m.u), m.t, ocp.p], [ca.densify(stacked)])
    w, free = ca.MX.sym("w", m.nx + m.nu), np.full(m.nx + m.nu, np.inf)
    return Elastic(
        w=w,
        p=ca.MX(0, 1),
        hard=ca.MX(0, 1),
        rows=function(w, t, subject.data.values.at(fraction)[0]),
        lower=np.array([a[2] for a in asked]),
        upper=np.array([a[3] for a in asked]),
        owner=np.arange(len(asked)),
        demands=tuple(a[0] for a in asked),
        box=(-free, free),
    )


def along(subject: Subject) -> tuple[Elastic, np.ndarray]:
    """Return the demands along the whole trajectory, and the node of every row."""
    tr, program = subject.program.transcription, subject.program.transcription.program
    bounds = tr.bounds(subject.data)
    asked, rows, nodes, owner, low, high = [], [], [], [], [], []

    def add(demand: Demand, row: int, node: int, lower: float, upper: float) -> None:
        if demand not in asked:
            asked.append(demand)
        rows.append(row)
        nodes.append(node)
        owner.append(asked.index(demand))
        low.append(lower)
        high.append(upper)

    hard = [i for i, row in enumerate(tr.rows) if row.place in _HARD]
    for i, (row, demand) in enumerate(zip(tr.rows, _demands_of_rows(subject), strict=True)):
        if demand is not None:
            add(demand, i, row.node, row.lower, row.upper)
    m, count, width = subject.ocp.model, len(tr.rows), tr.nz + subject.ocp.model.nu
    box = (bounds["lbx"].copy(), bounds["ubx"].copy())
    is_start = (np.arange(len(box[0])) < m.nx) & (not subject.ocp.has_free_start)
    for kind, block, first in (("state", m.x, 0), ("control", m.u, tr.nz)):
        for demand, symbol, lower, upper in of_box(subject, kind):
            for j in range(first + _place(block, symbol), len(box[0]), width):
                if not is_start[j]:
                    add(demand, count + j, j // width, lower, upper)
                    box[0][j], box[1][j] = -np.inf, np.inf
    everything = ca.vertcat(program["g"], program["x"])
    elastic = Elastic(
        w=program["x"],
        p=program["p"],
        hard=program["g"][hard],
        rows=everything[rows],
        lower=np.array(low),
        upper=np.array(high),
        owner=np.array(owner),
        demands=tuple(asked),
        box=box,
    )
    return elastic, np.array(nodes)


def _place(block: ca.SX, symbol: ca.SX) -> int:
    return [e.element_hash() for e in ca.vertsplit(block)].index(symbol.element_hash())


def _demands_of_rows(subject: Subject) -> list[Demand | None]:
    """Return the demand of every row of the program; None for dynamics and time."""
    ocp, tr = subject.ocp, subject.program.transcription
    given = {
        place: [d for c in ocp.at(place) for d, *_ in of_constraint(subject, c)]
        for place in ("path", "initial", "terminal")
    }
    late = [
        d
        for d, on_control in zip(given["path"], ocp.functions.path_on_control, strict=True)
        if not on_control
    ]
    counted: dict[tuple[str, int], int] = {}
    result: list[Demand | None] = []
    for row in tr.rows:
        if row.place in _HARD:
            result.append(None)
            continue
        which = counted.get((row.place, row.node), 0)
        counted[row.place, row.node] = which + 1
        here = late if row.place == "path" and row.node == tr.n else given[row.place]
        result.append(here[which])
    return result
