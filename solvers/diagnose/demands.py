"""What bounds and constraints demand, and the elastic problem of one instant."""

from collections.abc import Iterator, Sequence
from typing import Literal

import casadi as ca
import numpy as np

from ocp import Constraint
from solvers.diagnose.elastic_program import Demand, ElasticProgram
from solvers.diagnose.graph import appearing
from solvers.diagnose.subject import DiagnosedProblem

Asked = tuple[Demand, ca.SX, float, float]


def size(*numbers: float) -> float:
    """Return how large a demand is: its largest finite number, or 1."""
    finite = [abs(v) for v in numbers if np.isfinite(v) and v != 0.0]
    return max(finite, default=1.0)


def of_box(subject: DiagnosedProblem, kind: Literal["state", "control"]) -> Iterator[Asked]:
    """Yield every finite bound; those of one control are one demand, those of a state two.

    A control that is too weak is so in both directions; of a state one side stands in the way.
    """
    ocp, m = subject.ocp, subject.ocp.model
    is_control = kind == "control"
    box, symbols = (ocp.control_bounds, m.u) if is_control else (ocp.state_bounds, m.x)
    names = m.u_names if is_control else m.x_names
    for i, name in enumerate(names):
        lower, upper = float(np.asarray(box.lower)[i]), float(np.asarray(box.upper)[i])
        for side, low, high in (("lower", lower, np.inf), ("upper", -np.inf, upper)):
            number = low if side == "lower" else high
            if not np.isfinite(number):
                continue
            label = f"the {side} bound {number:g} of {name}"
            if is_control:
                label = f"the box [{lower:g}, {upper:g}] of {name}"
            unit, large = subject.unit(name), size(lower, upper)
            yield Demand((name,), label, unit, large, is_control), symbols[i], low, high


def of_start(subject: DiagnosedProblem, *, only_constants: bool = False) -> Iterator[Asked]:
    """Yield the bounds of a free start, and of unknown constants: one demand each."""
    ocp, box = subject.ocp, subject.ocp.start_bounds
    free = np.flatnonzero(ocp.start_is_free).tolist()
    for i in subject.constants if only_constants else free:
        low, high = float(np.asarray(box.lower)[i]), float(np.asarray(box.upper)[i])
        if np.isfinite([low, high]).any():
            name = ocp.model.x_names[i]
            label = f"the bounds [{low:g}, {high:g}] of {name}"
            label += "" if i in subject.constants else " at the start"
            demand = Demand((name,), label, subject.unit(name), size(low, high))
            yield demand, ocp.model.x[i], low, high


def of_constraint(
    subject: DiagnosedProblem, c: Constraint, instant: float | None = None
) -> Iterator[Asked]:
    """Yield every row of a constraint; of one at instants as it was written: at which."""
    label, when = subject.terms.label(c, instant), subject.terms.instant(c)
    for i, (row, low, high) in enumerate(
        zip(ca.vertsplit(c.expression), np.asarray(c.lower), np.asarray(c.upper), strict=True)
    ):
        names = appearing(subject.ocp, row)
        which = f" (row {i}, {names[0] if len(names) == 1 else 'several'})" if c.size > 1 else ""
        unit = subject.unit(names[0]) if row.is_symbolic() else ""
        where = (c.name, *names) if row.is_symbolic() else (c.name,)
        yield (
            Demand(where, label + which, unit, size(float(low), float(high)), instant=when),
            row,
            float(low),
            float(high),
        )


def at_instant(
    subject: DiagnosedProblem,
    asked: list[Asked],
    t: float,
    fraction: float,
    given: Sequence[int] = (),
) -> ElasticProgram:
    """Return the demands on (x, u) at one instant, of which only the ``given`` states are fixed."""
    ocp, m = subject.ocp, subject.ocp.model
    stacked = ca.vertcat(*[row for _, row, _, _ in asked])
    function = ca.Function("rows", [ca.vertcat(m.x, m.u), m.t, ocp.p], [ca.densify(stacked)])
    demands = tuple(dict.fromkeys(demand for demand, *_ in asked))
    w, box = ca.MX.sym("w", m.nx + m.nu), np.full((2, m.nx + m.nu), [[-np.inf], [np.inf]])
    copied = [copy for copy, own in subject.copies.items() if not ocp.start_is_free[own]]
    fixed = [*given, *copied]
    box[:, fixed] = subject.data.x0[fixed]
    return ElasticProgram(
        w=w,
        p=ca.MX(0, 1),
        hard=ca.MX(0, 1),
        rows=function(w, t, subject.data.values.at(fraction)[0]),
        lower=np.array([a[2] for a in asked]),
        upper=np.array([a[3] for a in asked]),
        owner=np.array([demands.index(demand) for demand, *_ in asked]),
        demands=demands,
        box=(box[0], box[1]),
    )
