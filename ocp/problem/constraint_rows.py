"""The rows that a problem imposes: what each one is, where it holds, by how much it is violated."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import casadi as ca
import numpy as np

from ocp.problem.constraint import Box, Constraint, Place
from ocp.problem.model import Model

#: An ``"input"`` row limits what is sent: it can always be met, by whatever acts. A ``"soft"`` row
#: may be exceeded at a price that its solver knows. Any other row is ``"hard"``: to meet it may
#: take time, or be impossible.
RowKind = Literal["hard", "soft", "input"]


@dataclass(frozen=True)
class ConstraintRow:
    """One row, lower <= c(x, u, t, p) <= upper.

    Attributes:
        name: of the constraint, of a state's dynamics, or of a bound.
        place: what kind of condition it is.
        node: where on a grid it holds, 0 to N.
        lower: least value.
        upper: largest value.
        kind: whether it limits the input, and whether it may be exceeded.
        on_control: whether it depends on a control.
        label: what a message calls it; default: its name.
        unit: what a violation of 1 is in the units of the user: of a scaled problem its size.
    """

    name: str
    place: Literal["dynamics", "time"] | Place
    node: int
    lower: float
    upper: float
    kind: RowKind = "hard"
    on_control: bool = False
    label: str = ""
    unit: float = 1.0

    @property
    def is_equation(self) -> bool:
        """Whether the row is an equation."""
        return self.lower == self.upper

    @property
    def is_limited(self) -> bool:
        """Whether it can be violated at all."""
        return self.lower > -np.inf or self.upper < np.inf

    def __str__(self) -> str:
        """Return what a message calls it."""
        return self.label or self.name


class Violation(NamedTuple):
    """By how much a row is violated, and when; 0 and None where nothing is.

    Attributes:
        amount: distance from the bound, in the unit of the row; inf where it is no number.
        row: which.
        t: when [s].
        size: what the row is measured in, where that was asked for.
    """

    amount: float = 0.0
    row: ConstraintRow | None = None
    t: float = 0.0
    size: float = 1.0

    @property
    def relative(self) -> float:
        """The amount in sizes of the row."""
        return self.amount / self.size

    @property
    def where(self) -> str:
        """The row, and when; empty where nothing is violated."""
        if self.row is None:
            return ""
        when = f" at t = {self.t:.4g} s" if self.row.place in ("path", "instants") else ""
        return f"{self.row}{when}"

    def __str__(self) -> str:
        """Return the whole sentence; empty where nothing is violated."""
        if self.row is None:
            return ""
        amount = self.amount * self.row.unit
        return f"{self.row} is violated by {amount:.3g} at t = {self.t:.4g} s"


@dataclass(frozen=True, eq=False)
class ConstraintRows:
    """Rows that hold together at one instant.

    Attributes:
        rows: what each one is, (m,).
        expression: their values, in the symbols of the problem, (m, 1).
    """

    rows: tuple[ConstraintRow, ...]
    expression: ca.SX

    @classmethod
    def of(cls, constraints: Iterable[Constraint], place: Place, model: Model) -> "ConstraintRows":
        """Return the rows of constraints, one for each component, in their order."""
        constraints = tuple(constraints)
        expression = ca.vertcat(ca.SX(0, 1), *[c.expression for c in constraints])
        label = "constraint" if place in ("path", "instants") else f"{place} constraint"
        on_x, on_u = (depends_on(expression, symbols) for symbols in (model.x, model.u))
        parts = (
            (c, low, high)
            for c in constraints
            for low, high in zip(np.asarray(c.lower), np.asarray(c.upper), strict=True)
        )
        rows = tuple(
            ConstraintRow(
                name=c.name,
                place=place,
                node=0,
                lower=float(low) if c.soft is None else -np.inf,
                upper=float(high) if c.soft is None else np.inf,
                kind=_kind(c, on_state=bool(x), on_control=bool(u)),
                on_control=bool(u),
                label=f"{label} '{c.name}'",
            )
            for (c, low, high), x, u in zip(parts, on_x, on_u, strict=True)
        )
        return cls(rows, expression)

    @classmethod
    def of_bounds(
        cls,
        box: Box,
        symbols: ca.SX,
        names: tuple[str, ...],
        *,
        kind: RowKind,
        place: Place = "path",
    ) -> "ConstraintRows":
        """Return the bounds of states, or of controls, as rows."""
        lower, upper = np.asarray(box.lower), np.asarray(box.upper)
        rows = tuple(
            ConstraintRow(
                name=f"bound of {name}",
                place=place,
                node=0,
                lower=float(low),
                upper=float(high),
                kind=kind,
                on_control=kind == "input",
            )
            for name, low, high in zip(names, lower, upper, strict=True)
        )
        return cls(rows, symbols)

    def __len__(self) -> int:
        """Return the number of rows m."""
        return len(self.rows)

    def __add__(self, other: "ConstraintRows") -> "ConstraintRows":
        """Return the rows of both, these first."""
        return ConstraintRows(
            (*self.rows, *other.rows), ca.vertcat(self.expression, other.expression)
        )

    def where(self, chosen: np.ndarray) -> "ConstraintRows":
        """Return some of the rows, (m,) of bool says which."""
        index = np.flatnonzero(chosen).tolist()
        return ConstraintRows(tuple(self.rows[i] for i in index), self.expression[index, :])

    def of_kind(self, kind: RowKind) -> "ConstraintRows":
        """Return the rows of one kind."""
        return self.where(np.array([row.kind == kind for row in self.rows], dtype=bool))

    @cached_property
    def box(self) -> Box:
        """Their bounds, each (m,)."""
        return Box(
            np.array([row.lower for row in self.rows]), np.array([row.upper for row in self.rows])
        )

    @cached_property
    def on_control(self) -> np.ndarray:
        """Which of them depend on a control, bool (m,)."""
        return np.array([row.on_control for row in self.rows], dtype=bool)

    @cached_property
    def is_imposed(self) -> bool:
        """Whether any of them can be violated at all."""
        return bool(self.rows) and self.box.is_active

    def softened(self) -> "ConstraintRows":
        """Return the rows where those that do not limit the input may be exceeded."""
        rows = [
            row if row.kind == "input" else replace(row, kind="soft", lower=-np.inf, upper=np.inf)
            for row in self.rows
        ]
        return ConstraintRows(tuple(rows), self.expression)

    def excess(self, values: np.ndarray) -> np.ndarray:
        """Return by how much each value (..., m) lies outside: 0 inside, inf for no number."""
        return self.box.excess(values)

    def largest_violation(
        self,
        values: np.ndarray,
        t: np.ndarray,
        *,
        exempt: np.ndarray | None = None,
        sizes: np.ndarray | None = None,
    ) -> Violation:
        """Return the largest violation along a trajectory, the earliest where several are equal.

        Args:
            values: (K, m).
            t: instants [s], (K,).
            exempt: where a row does not hold, bool (K, m).
            sizes: what each row is measured in, (m,); None: 1.
        """
        if not values.size or self.box.contains(values):
            return Violation()
        excess = self.excess(values)
        if exempt is not None:
            excess[exempt] = 0.0
        relative = excess if sizes is None else excess / sizes
        k, i = divmod(int(relative.argmax()), len(self.rows))
        amount, size = float(excess[k, i]), 1.0 if sizes is None else float(sizes[i])
        return Violation(amount, self.rows[i], float(t[k]), size) if amount > 0.0 else Violation()

    def largest_of_each(
        self, values: np.ndarray, t: np.ndarray, *, exempt: np.ndarray | None = None
    ) -> tuple[Violation, ...]:
        """Return the largest violation of every row along a trajectory, 0 where there is none.

        Args:
            values: (K, m).
            t: instants [s], (K,).
            exempt: where a row does not hold, bool (K, m).
        """
        if not values.size:
            return ()
        excess = self.excess(values)
        if exempt is not None:
            excess[exempt] = 0.0
        when = excess.argmax(axis=0)
        return tuple(
            Violation(float(excess[k, i]), row, float(t[k]))
            for i, (k, row) in enumerate(zip(when, self.rows, strict=True))
        )


@dataclass(frozen=True, eq=False)
class ProblemRows:
    """All rows of a problem, by where they hold.

    Attributes:
        states: bounds of the states; at every instant.
        controls: bounds of the controls; wherever one acts.
        path: path constraints; those with a control wherever one acts, the others everywhere.
        start: bounds of what is free of the start; at the start.
        initial: at the start.
        unknowns: bounds of the unknown constants.
        terminal: at the end.
        integral: of the integrals over the horizon.
        instants: each at the instants of its constraint.
        invariants: what the exact dynamics keep; no method imposes them.
        rates: bounds of the rates of controls; from the last input on.
        time: the bounds of the duration [s].
    """

    states: ConstraintRows
    controls: ConstraintRows
    path: ConstraintRows
    start: ConstraintRows
    initial: ConstraintRows
    unknowns: ConstraintRows
    terminal: ConstraintRows
    integral: ConstraintRows
    instants: ConstraintRows
    invariants: ConstraintRows
    rates: ConstraintRows
    time: ConstraintRow

    def softened(self) -> "ProblemRows":
        """Return the rows where states, path and end may be exceeded, and what is sent may not."""
        return replace(
            self,
            states=self.states.softened(),
            path=self.path.softened(),
            terminal=self.terminal.softened(),
        )


class RowSizes(NamedTuple):
    """What the rows of a problem are measured in, one size a row."""

    states: np.ndarray
    controls: np.ndarray
    path: np.ndarray
    terminal: np.ndarray


@dataclass(frozen=True, eq=False)
class ImposedRows:
    """The rows that a solver imposes, and the nodes of its grid at which it does not.

    Attributes:
        rows: of the problem; soft ones have no bounds.
        no_control_rows: at which nodes rows with a control do not hold, beside the last one, where
            no control is left, bool (N + 1,); None: at no other.
        no_state_rows: at which nodes rows of states alone do not hold, beside the first one, which
            is measured, bool (N + 1,); None: at no other.
        sizes: what rows are measured in; None: 1.
    """

    rows: ProblemRows
    no_control_rows: np.ndarray | None = None
    no_state_rows: np.ndarray | None = None
    sizes: RowSizes | None = None


def _kind(c: Constraint, *, on_state: bool, on_control: bool) -> RowKind:
    if c.soft is not None:
        return "soft"
    limits = on_control and not on_state if c.limits_input is None else c.limits_input
    return "input" if limits else "hard"


def depends_on(expression: ca.SX, symbols: ca.SX) -> np.ndarray:
    """Return which rows of a column contain any of some symbols, bool (m,)."""
    structure = np.array(ca.DM(ca.jacobian_sparsity(expression, symbols), 1.0))
    return structure.sum(axis=1) > 0.0
