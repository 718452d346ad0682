"""The nodes of a grid of N intervals, with the knots of signals among them."""

from collections.abc import Iterator

import numpy as np

from ocp.checks.errors import ProblemError, UnsupportedProblem
from ocp.problem.grid import Grid
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Signal, Steps

# Nodes that differ by less are the same, in fractions of the horizon.
_SAME = 1e-9
# A signal bends where its second difference exceeds this share of its largest magnitude.
_BENDS = 1e-9
# A grid of so many intervals a space is halved; one with fewer is shared out anew.
_HALVED = 4


def node_fractions(ocp: OCP, intervals: int | Grid) -> np.ndarray:
    """Return the nodes of N intervals as fractions of the horizon, (N + 1,).

    Those of a ``Grid`` are as they are. A number of intervals is equally spaced where the knots of
    all declared signals are among such nodes. Else they are shared out among the spaces between
    the knots, in proportion to their lengths and at least one each, since the integration of an
    interval sees no jump inside it.
    Twice as many are then the same ones halved, unless as many equal ones hit the knots.
    Where there are more knots than intervals, those at which the declared samples bend are
    taken in, then those at which they jump, then none but instants. In discrete time the steps are
    the nodes.

    Args:
        ocp: the problem.
        intervals: N, or the nodes.

    Raises:
        UnsupportedProblem: for a ``Grid`` in discrete time.
        ProblemError: where instants of data or constraints are no nodes.
    """
    if isinstance(intervals, Grid):
        if ocp.model.is_discrete:
            raise UnsupportedProblem(
                f"{ocp.name}: the steps of the discrete-time model '{ocp.model.name}' are the "
                "nodes, it takes no Grid; blocks hold its controls over several steps"
            )
        return _with_steps(ocp, np.array(intervals.fractions))
    if ocp.model.is_discrete:
        return np.linspace(0.0, 1.0, (ocp.steps or intervals) + 1)
    uniform = np.linspace(0.0, 1.0, intervals + 1)
    count = len(instant_fractions(ocp))
    if count >= intervals:
        raise ProblemError(
            f"{ocp.name}: the {count} instants of its data or constraints need more than {count} "
            f"intervals, not {intervals}"
        )
    for knots in _candidates(ocp):
        if (np.abs(knots[:, None] - uniform).min(axis=1, initial=1.0) <= _SAME).all():
            return uniform
        if len(knots) < intervals:
            return _shared_out(np.array([0.0, *knots, 1.0]), intervals)
    return uniform


def node_widths(nodes: np.ndarray) -> np.ndarray:
    """Return the lengths of the intervals between nodes, (N,); equal ones without rounding."""
    widths = np.diff(nodes)
    if np.ptp(widths) <= _SAME * widths[0]:
        return np.full(len(widths), 1.0 / len(widths))
    return widths


def _candidates(ocp: OCP) -> Iterator[np.ndarray]:
    """Yield inner knots: all, where the samples bend, where they jump, instants alone."""
    signals = [entry for entry in ocp.parameters if isinstance(entry, Signal)]
    steps = instant_fractions(ocp)
    for which in (_all, _bending, _jumping):
        each = [which(signal) for signal in signals]
        found = np.sort(np.concatenate([steps, *each]))
        yield found[np.diff(found, prepend=0.0) > _SAME]
    yield steps


def instant_fractions(ocp: OCP) -> np.ndarray:
    """Return the instants of data and constraints inside the horizon of a normal form.

    Each once, as fractions of the horizon, (K,).
    """
    each = [entry.inner for entry in ocp.parameters if isinstance(entry, Steps)]
    found = np.sort(np.concatenate([np.zeros(0), *each]))
    return found[np.diff(found, prepend=0.0) > _SAME]


def _with_steps(ocp: OCP, nodes: np.ndarray) -> np.ndarray:
    """Return nodes that a user gave, if the instants of data and constraints are among them."""
    instants = instant_fractions(ocp)
    apart = np.abs(instants[:, None] - nodes).min(axis=1) > _SAME
    if apart.any():
        missing = float(instants[apart.argmax()])
        raise ProblemError(
            f"{ocp.name}: the grid has no node at {missing:.6g} of the horizon, where there are "
            "data or a constraint: add it by Grid.with_nodes"
        )
    return nodes


def _all(signal: Signal) -> np.ndarray:
    return signal.knots[1:-1]


def _bending(signal: Signal) -> np.ndarray:
    """Inner knots at which a held signal jumps, or the slope of a linear one does."""
    samples = signal.value
    change = np.diff(samples[:-1], axis=0)
    if signal.hold == "linear":
        change = np.diff(samples, n=2, axis=0)
    moved = (np.abs(change) > _BENDS * np.abs(samples).max()).any(axis=1)
    return signal.knots[1:-1][moved]


def _jumping(signal: Signal) -> np.ndarray:
    return _bending(signal) if signal.hold == "held" else np.zeros(0)


def _shared_out(edges: np.ndarray, intervals: int) -> np.ndarray:
    """Cut the spaces between edges into a number of intervals in all, as equal as possible.

    Twice as many are the same ones halved, which those need who compare two grids.
    """
    lengths, coarse = np.diff(edges), intervals
    while coarse % 2 == 0 and coarse // 2 >= _HALVED * len(lengths):
        coarse //= 2
    counts = np.ones(len(lengths), dtype=int)
    for _ in range(coarse - len(lengths)):
        counts[np.argmax(lengths / counts)] += 1
    counts *= intervals // coarse
    parts = [
        np.linspace(left, right, count + 1)[:-1]
        for left, right, count in zip(edges, edges[1:], counts, strict=False)
    ]
    return np.append(np.concatenate(parts), 1.0)
