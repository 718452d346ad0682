"""The arcs of a trajectory: which control follows which law, and until when."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from ocp import OCP, Solution

# A bound this close, relative to 1 + abs(bound), is met on a whole piece.
_MET = 1e-3
# Arcs that take less of the horizon are what a mesh leaves of a switch: it is coarse where the
# control is free in between.
_SHORTEST, _SHORTEST_FREE = 2e-3, 2e-2


class NoArcsError(Exception):
    """A method on arcs does not apply; the message says why."""


@dataclass(frozen=True)
class ArcLaw:
    """What decides a control while something is active.

    Attributes:
        name: what is active, for people and for comparison.
        value: the control, in the states, the time and the parameters of the problem.
        push: times H_u it is not positive at an optimum: the multiplier has the right sign.
            Zero for an equation, whose multiplier may have any.
        row: which row of the path constraints it keeps at its bound; None: a bound of the control.
    """

    name: str
    value: ca.SX
    push: ca.SX
    row: int | None = None


@dataclass(frozen=True)
class Arc:
    """A part of a trajectory.

    Attributes:
        start: fraction of the horizon.
        end: fraction of the horizon.
        laws: of each control; None where it is chosen freely.
    """

    start: float
    end: float
    laws: tuple[ArcLaw | None, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """What is active, control by control."""
        return tuple(law.name if law else "free" for law in self.laws)

    @property
    def shortest(self) -> float:
        """Fraction of the horizon below which it is no arc."""
        return _SHORTEST if all(self.laws) else _SHORTEST_FREE


def arcs_of(answer: Solution) -> tuple[Arc, ...]:
    """Return the arcs of a trajectory whose control is a polynomial from break to break.

    A piece counts to an arc if the law of the arc holds on all of it. Pieces between two arcs
    that follow neither, such as those in which a switch lies, are shared between the two if
    they are short. There are none where every piece is too short: the control chatters.

    Args:
        answer: of collocation.
    """
    edges = answer.fractions[answer.breaks]
    laws = [_laws(answer.problem, j) for j in range(answer.problem.model.nu)]
    met = [_met(answer, j, laws[j]) for j in range(answer.problem.model.nu)]
    pieces = [
        Arc(float(left), float(right), tuple(m[k] for m in met))
        for k, (left, right) in enumerate(pairwise(edges))
    ]
    long = [arc for arc in _joined(pieces) if arc.end - arc.start > arc.shortest]
    return tuple(_joined(list(_meeting(_joined(long))))) if long else ()


def _laws(ocp: OCP, j: int) -> list[tuple[ArcLaw, ca.SX]]:
    """What can decide a control, and by how much each is missed.

    An equation decides it everywhere: where one does, nothing else is asked.
    """
    u, found, equations = ca.vertsplit(ocp.model.u)[j], [], []
    box = ocp.control_bounds
    low, high = (float(np.asarray(values)[j]) for values in (box.lower, box.upper))
    for side, sign, bound in _sides(low, high):
        law = ArcLaw(f"{side} bound of {u}", ca.SX(bound), ca.SX(sign))
        (found if sign else equations).append((law, _missed(u, bound)))
    rows = [
        (c.name, e, float(low), float(high))
        for c in ocp.at("path")
        for e, low, high in zip(
            ca.vertsplit(ca.SX(c.expression)), np.asarray(c.lower), np.asarray(c.upper), strict=True
        )
    ]
    for i, (name, e, low, high) in enumerate(rows):
        slope = ca.jacobian(e, ocp.model.u)
        if slope.nnz() != 1 or slope.sparsity().get_col() != [j] or ca.depends_on(slope, u):
            continue
        rest = ca.substitute(e, u, 0.0)
        for side, sign, bound in _sides(low, high):
            law = ArcLaw(f"{name} {side}", (bound - rest) / slope[0, j], sign * slope[0, j], i)
            (found if sign else equations).append((law, _missed(e, bound)))
    return equations or found


def _sides(low: float, high: float) -> list[tuple[str, float, float]]:
    """Finite bounds with their names and signs; of an equation one, whose multiplier has any."""
    if low == high:
        return [("equation", 0.0, low)]
    sides = ("lower", -1.0, low), ("upper", 1.0, high)
    return [side for side in sides if np.isfinite(side[2])]


def _missed(expression: ca.SX, bound: float) -> ca.SX:
    return ca.fabs(expression - bound) / (1.0 + abs(bound))


def _met(answer: Solution, j: int, laws: list[tuple[ArcLaw, ca.SX]]) -> list[ArcLaw | None]:
    """The law that a control follows on each piece, judged at five instants of it."""
    count = len(answer.breaks) - 1
    if not laws:
        return [None] * count
    ocp, edges = answer.problem, answer.t[answer.breaks]
    inside = np.linspace(0.02, 0.98, 5)
    times = (edges[:-1, None] + inside * np.diff(edges)[:, None]).ravel()
    m = ocp.model
    missed = ca.Function("missed", [m.x, m.u, m.t, ocp.p], [ca.vertcat(*[e for _, e in laws])])
    p = answer.data.values.at((times - answer.t[0]) / answer.duration)
    args = (answer.state(times).T, answer.control(times).T, times[None, :], p.T)
    values = np.array(missed.map(len(times))(*args)).reshape(len(laws), count, len(inside))
    worst = values.max(axis=2)
    best = worst.argmin(axis=0)
    return [laws[i][0] if worst[i, k] <= _MET else None for k, i in enumerate(best)]


def _joined(arcs: list[Arc]) -> list[Arc]:
    """Make one of neighbours with the same laws."""
    result: list[Arc] = []
    for arc in arcs:
        if result and result[-1].names == arc.names:
            result[-1] = Arc(result[-1].start, arc.end, arc.laws)
        else:
            result.append(arc)
    return result


def _meeting(arcs: list[Arc]) -> Iterator[Arc]:
    """Let the arcs meet in the middle of what lies between them."""
    ends = [(a.end + b.start) / 2.0 for a, b in pairwise(arcs)]
    for arc, start, end in zip(arcs, [0.0, *ends], [*ends, 1.0], strict=True):
        yield Arc(start, end, arc.laws)
