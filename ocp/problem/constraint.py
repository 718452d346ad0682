"""Bounds and constraints, each with a name a message can use."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import (
    check_flag,
    check_instance,
    check_nominal,
    check_numbers,
    check_numeric,
)
from ocp.checks.errors import ProblemError
from ocp.checks.expressions import check_column, readable
from ocp.problem.portable import Portable

Place = Literal["path", "initial", "terminal", "integral", "instants"]
PLACES: tuple[Place, ...] = get_args(Place)
_RELATIONS = (ca.OP_LE, ca.OP_LT, ca.OP_EQ, ca.OP_NE)


def check_place(value: object, what: str) -> None:
    """Check that ``value`` is where a constraint may hold, or raise ``ProblemError``."""
    if value not in PLACES:
        raise ProblemError(f"{what} = {value!r} is no place; {', '.join(map(repr, PLACES))} are")


@dataclass(frozen=True, eq=False)
class Box(Portable):
    """Simple bounds ``lower <= v <= upper``; a number holds for every component.

    Args:
        lower: lower bound, a number or (n,); ``-inf``: none.
        upper: upper bound, a number or (n,); ``inf``: none.
    """

    lower: ArrayLike = -np.inf
    upper: ArrayLike = np.inf

    def sized(self, size: int, what: str) -> "Box":
        """Return the box with bounds of shape (size,), checked."""
        lower = check_numbers(self.lower, size, f"{what}: lower", finite=False)
        upper = check_numbers(self.upper, size, f"{what}: upper", finite=False)
        wrong = np.flatnonzero((lower > upper) | (lower == np.inf) | (upper == -np.inf))
        if wrong.size:
            i = int(wrong[0])
            raise ProblemError(f"{what}[{i}]: no number lies between {lower[i]} and {upper[i]}")
        return Box(lower, upper)

    def __and__(self, other: "Box") -> "Box":
        """Return the box of both vectors, one behind the other; both are sized."""
        return Box(np.append(self.lower, other.lower), np.append(self.upper, other.upper))

    def __getitem__(self, index: list[int]) -> "Box":
        """Return the box of some components; it is sized."""
        return Box(np.asarray(self.lower)[index], np.asarray(self.upper)[index])

    @classmethod
    def unbounded(cls, size: int) -> "Box":
        """Return a box (size,) that bounds nothing."""
        return cls(np.full(size, -np.inf), np.full(size, np.inf))

    @cached_property
    def is_active(self) -> bool:
        """Whether any component is bounded at all."""
        return bool(np.isfinite(self.lower).any() or np.isfinite(self.upper).any())

    def inside(self) -> np.ndarray:
        """Return a point within, not on a bound: the middle, 1 off a single bound, or 0 (n,)."""
        lower, upper = np.asarray(self.lower, dtype=float), np.asarray(self.upper, dtype=float)
        is_below, is_above = np.isfinite(lower), np.isfinite(upper)
        below, above = np.where(is_below, lower, 0.0), np.where(is_above, upper, 0.0)
        one_sided = np.where(is_below, np.maximum(below + 1.0, 0.0), np.minimum(above - 1.0, 0.0))
        one_sided = np.where(is_below | is_above, one_sided, 0.0)
        return np.where(is_below & is_above, (below + above) / 2.0, one_sided)

    def clip(self, value: np.ndarray) -> np.ndarray:
        """Return the nearest point of the box, along the last axis."""
        # np.clip and np.nan_to_num cost several times what they do to a short row.
        return np.minimum(np.maximum(value, self.lower), self.upper)

    def clip_expression(self, value: Any) -> Any:
        """Return ``clip`` of a column (n,) of SX or MX; what has no bound is left as it is."""
        lower, upper = (np.broadcast_to(b, value.numel()) for b in (self.lower, self.upper))
        rows = zip(ca.vertsplit(value), lower, upper, strict=True)
        raised = ((ca.fmax(v, a) if np.isfinite(a) else v, b) for v, a, b in rows)
        return ca.vertcat(*(ca.fmin(v, b) if np.isfinite(b) else v for v, b in raised))

    def contains(self, value: np.ndarray) -> bool:
        """Whether every component lies inside; what is no number does not."""
        inside = (value >= self.lower) & (value <= self.upper)
        return np.count_nonzero(inside) == inside.size  # a third of the time of all()

    def excess(self, value: np.ndarray) -> np.ndarray:
        """Return by how much each component lies outside: 0 inside, inf where it is no number."""
        outside = np.maximum(
            0.0, np.maximum(np.subtract(self.lower, value), np.subtract(value, self.upper))
        )
        return np.where(np.isnan(outside), np.inf, outside)


@dataclass(frozen=True, eq=False)
class Soft(Portable):
    """The price of what exceeds a constraint.

    For an excess e of each row, linear * e + quadratic * e^2: along the way per second (per step in
    discrete time), at the end once. A linear price above the multiplier of the hard constraint is
    exact: the constraint is then met wherever it can be. One that is only quadratic always gives
    way a little.

    Args:
        linear: price per unit of the row, a number or (m,).
        quadratic: price per unit squared, a number or (m,).

    Raises:
        ProblemError: if a price is negative, or a row has none.
    """

    linear: ArrayLike = 0.0
    quadratic: ArrayLike = 0.0

    def sized(self, size: int, what: str) -> "Soft":
        """Return the prices (size,) of each row, checked."""
        each = {
            name: check_numbers(value, size, f"{what}: soft, {name} price")
            for name, value in (("linear", self.linear), ("quadratic", self.quadratic))
        }
        for name, values in each.items():
            if (values < 0.0).any():
                raise ProblemError(f"{what}: soft, {name} price = {values}: it must be 0 or more")
        free = np.flatnonzero(each["linear"] + each["quadratic"] == 0.0)
        if free.size:
            raise ProblemError(
                f"{what}: row {free[0]} is soft at no price: give one, or leave the row out"
            )
        return Soft(**each)

    def cost(self, excess: ca.SX) -> ca.SX:
        """Return what an excess (m,) of all rows costs."""
        linear, quadratic = (ca.DM(np.asarray(v, float)) for v in (self.linear, self.quadratic))
        return ca.dot(linear, excess) + ca.dot(quadratic, excess**2)

    def rows(self, index: list[int]) -> "Soft":
        """Return the prices of some rows."""
        return Soft(np.asarray(self.linear)[index], np.asarray(self.quadratic)[index])

    def per(self, size: np.ndarray | float, cost: float) -> "Soft":
        """Return the prices where rows are measured in sizes, and cost in one of its own."""
        linear, quadratic = np.asarray(self.linear), np.asarray(self.quadratic)
        return Soft(linear * size / cost, quadratic * np.square(size) / cost)


@dataclass(frozen=True, eq=False)
class Constraint(Portable):
    """``lower <= expression <= upper`` at a place of the trajectory.

    Args:
        name: what a message calls it.
        expression: column (m,) in x, u, t and parameters; no u at ``"initial"`` and ``"terminal"``.
        lower: number or (m,); equal to ``upper`` for an equation.
        upper: number or (m,).
        at: ``"path"`` (every instant), ``"initial"`` (the start is then free on the
            manifold, and ``x0`` a guess), ``"terminal"``, or ``"integral"``: the integral of the
            expression over the horizon lies between the bounds. An instant, or several: seconds
            since the start of the horizon (a waypoint); kept as ``"instants"`` and ``times``.
        nominal: a typical size of the rows, a number or (m,), to measure a violation by; None: it
            is estimated, see ``Solution.sizes``.
        limits_input: whether the rows limit what an actuator is sent, so that whatever acts has to
            meet them and no penalty makes them soft; None: where they contain controls and no
            states. With a state that holds the actuator's position, say so.
        soft: what it costs to exceed the bounds; None: they are hard.
        times: instants [s] of ``"instants"``, increasing, (K,).

    Raises:
        ProblemError: naming the constraint and what is wrong with place, expression or bounds.
    """

    name: str
    expression: ca.SX
    lower: ArrayLike = -np.inf
    upper: ArrayLike = np.inf
    at: Place | float | Sequence[float] = "path"
    nominal: ArrayLike | None = None
    limits_input: bool | None = None
    soft: Soft | None = None
    times: ArrayLike = ()

    def __post_init__(self) -> None:
        """Stack the expression and size the bounds."""
        check_instance(self.name, str, "the name of a constraint")
        self._check_place()
        expression = check_column(self.expression, f"constraint '{self.name}'")
        for row in ca.vertsplit(expression):
            if row.op() in _RELATIONS:
                raise ProblemError(
                    f"constraint '{self.name}': {row} is true or false, not a value between "
                    "bounds; write Constraint(name, expression, lower, upper)"
                )
        box = Box(self.lower, self.upper).sized(expression.numel(), f"constraint '{self.name}'")
        object.__setattr__(self, "expression", expression)
        object.__setattr__(self, "lower", box.lower)
        object.__setattr__(self, "upper", box.upper)
        nominal = check_nominal(self.nominal, self.size, f"constraint '{self.name}': nominal")
        object.__setattr__(self, "nominal", nominal)
        if self.limits_input is not None:
            check_flag(self.limits_input, f"constraint '{self.name}': limits_input")
        self._check_soft()
        if self.limits_input and self.at != "path":
            raise ProblemError(
                f"constraint '{self.name}' limits an input: it has to hold at='path'"
            )

    def __repr__(self) -> str:
        """Return one line: the expression, its bounds, and where it holds."""
        rows = ", ".join(readable(row) for row in ca.vertsplit(self.expression))
        ends = f"{np.asarray(self.lower)} to {np.asarray(self.upper)}"
        soft = ", soft" if self.soft is not None else ""
        return f"<Constraint '{self.name}', {self.at}{soft}: {rows} in {ends}>"

    def _check_place(self) -> None:
        what = f"constraint '{self.name}': at"
        if isinstance(self.at, int | float | list | tuple | np.ndarray | np.number):
            object.__setattr__(self, "times", self.at)
            object.__setattr__(self, "at", "instants")
        check_place(self.at, what)
        times = np.atleast_1d(check_numeric(self.times, what))
        if (self.at == "instants") != bool(times.size):
            raise ProblemError(f"{what}: times are given for at='instants', and for no other place")
        if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
            raise ProblemError(f"{what}: instants must be finite and increase, not {times}")
        times.flags.writeable = False
        object.__setattr__(self, "times", times)

    @property
    def instants(self) -> np.ndarray:
        """Where it holds at ``"instants"`` [s], since the start of the horizon, (K,)."""
        return np.asarray(self.times)

    def _check_soft(self) -> None:
        if self.soft is None:
            return
        what = f"constraint '{self.name}'"
        check_instance(self.soft, Soft, f"{what}: soft")
        if self.at not in ("path", "terminal"):
            raise ProblemError(
                f"{what}: soft constraints hold at='path' or at='terminal'; write the price of "
                f"this one into a cost"
            )
        if self.limits_input:
            raise ProblemError(f"{what} limits an input: no price makes it soft")
        object.__setattr__(self, "soft", self.soft.sized(self.size, what))

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.expression.numel()

    @property
    def box(self) -> Box:
        """The bounds, each (size,)."""
        return Box(self.lower, self.upper)

    @property
    def is_equation(self) -> bool:
        """Whether every row is an equation."""
        return bool(np.all(np.asarray(self.lower) == np.asarray(self.upper)))


def unused(name: str, names: set[str]) -> str:
    """Return a name that none of these is, as like the given one as can be."""
    while name in names:
        name += "'"
    return name
