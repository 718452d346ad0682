"""How the start of a phase follows from the end of the one before."""

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from ocp.checks.arguments import check_instance
from ocp.checks.errors import ProblemError
from ocp.checks.expressions import check_column, element_names, refuse_foreign_symbols
from ocp.problem.ocp import OCP
from ocp.problem.portable import Portable


@dataclass(frozen=True, eq=False)
class Link(Portable):
    """What couples the end of a phase with the start of the next one.

    ``Link()``: the states go on as they are, matched by their names.
    ``Link(vertcat(h, -0.8 * v))``: a reset; the next phase starts at this.
    ``Link(states=("h",))``: only h goes on.
    ``Link(equations=before.model.x[0] - after.model.start[0])``: any equations of both.

    A state of the next phase that the link does not decide starts as that phase says by itself: at
    its ``x0``, or where the optimiser likes if it is named in ``free_start``.

    Args:
        reset: column in states, time and parameters of the phase before, one row for each state
            that is decided; None: they go on.
        states: names of the states of the next phase that are decided; None: all of them.
        equations: instead of both, a column (m,) that is zero, in states, time and parameters of
            the phase before, and in ``model.start`` of the next one; it decides the components of
            the start that it contains.

    Raises:
        ProblemError: if it is no column, or ``equations`` stand beside the others.
    """

    reset: ca.SX | None = None
    states: tuple[str, ...] | None = None
    equations: ca.SX | None = None

    def __post_init__(self) -> None:
        """Stack what was given loosely."""
        if self.equations is not None and (self.reset is not None or self.states is not None):
            raise ProblemError("link: equations say all; give neither reset nor states with them")
        for name in ("reset", "equations"):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, check_column(value, f"link: {name}"))
        if self.states is not None:
            check_instance(self.states, (tuple, list), "link: states")
            for state in self.states:
                check_instance(state, str, "link: an entry of states")
            object.__setattr__(self, "states", tuple(self.states))

    @property
    def goes_on(self) -> bool:
        """Whether all states go on as they are."""
        return self.reset is None and self.states is None and self.equations is None


class LinkRows(NamedTuple):
    """A link between two phases: rows that are zero.

    Attributes:
        before: which phase ends.
        after: which one starts.
        decided: components of its start that the rows decide.
        rows: (m,), in x, t and parameters of the one, and ``model.start`` of the other.
        labels: what a message calls each row.
    """

    before: int
    after: int
    decided: tuple[int, ...]
    rows: ca.SX
    labels: tuple[str, ...]


def link_rows(
    owner: str, link: Link, before: tuple[int, OCP], after: tuple[int, OCP], shared: ca.SX
) -> LinkRows:
    """Return the rows of a link between two phases, checked against both.

    Args:
        owner: name of the problem.
        link: between them.
        before: place and problem of the phase that ends.
        after: place and problem of the phase that starts.
        shared: symbols of the unknown constants of all phases.
    """
    (i, ending), (j, starting) = before, after
    what = f"{owner}: the link from '{ending.name}' to '{starting.name}'"
    m, start = ending.model, starting.model.start
    allowed = [m.x, m.t, ending.p, starting.p, shared]
    if link.equations is not None:
        refuse_foreign_symbols(link.equations, [*allowed, start], f"{what}: equations")
        used = {s.element_hash() for s in ca.symvar(link.equations)}
        parts = enumerate(ca.vertsplit(start))
        decided = tuple(k for k, symbol in parts if symbol.element_hash() in used)
        if not decided:
            raise ProblemError(
                f"{what}: the equations contain nothing of the start of '{starting.name}': it is "
                f"{starting.name}.model.start"
            )
        count = link.equations.numel()
        labels = [f"equation {k} of " * (count > 1) + what.split(": ")[1] for k in range(count)]
        return LinkRows(i, j, decided, link.equations, tuple(labels))
    names = starting.model.x_names
    decided = _places(what, names, names if link.states is None else link.states, starting.name)
    reset = _continued(what, ending, starting, decided) if link.reset is None else link.reset
    if reset.numel() != len(decided):
        raise ProblemError(
            f"{what}: the reset has {reset.numel()} rows, but {len(decided)} states of "
            f"'{starting.name}' are to follow from it: {', '.join(names[k] for k in decided)}"
        )
    refuse_foreign_symbols(reset, allowed, f"{what}: reset")
    rows = start[list(decided)] - reset
    labels = [f"the start of {names[k]} in phase '{starting.name}'" for k in decided]
    return LinkRows(i, j, decided, rows, tuple(labels))


def _places(
    what: str, names: tuple[str, ...], chosen: tuple[str, ...], phase: str
) -> tuple[int, ...]:
    for name in chosen:
        if names.count(name) != 1:
            count = "no state" if name not in names else "more than one state"
            raise ProblemError(
                f"{what}: '{name}' is {count} of '{phase}'; they are {', '.join(names)}"
            )
    return tuple(names.index(name) for name in chosen)


def _continued(what: str, ending: OCP, starting: OCP, decided: tuple[int, ...]) -> ca.SX:
    """Return the states of the phase before that have the names of those that are decided."""
    here, there = element_names(ending.model.x), element_names(starting.model.x)
    lost = [there[k] for k in decided if here.count(there[k]) != 1]
    if lost:
        raise ProblemError(
            f"{what}: '{ending.name}' has no state '{lost[0]}' to go on with, its states are "
            f"{', '.join(here)}; say what it starts at with Link(reset), or leave it to the phase "
            "with Link(states=(...))"
        )
    return ending.model.x[[here.index(there[k]) for k in decided]]
