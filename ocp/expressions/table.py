r"""A function that is given by samples: a lookup table.

In one argument the spline S of order 3 or 1 through the samples, in several the product of such
splines. Beyond the ends, with c the nearest point of the table,

.. math::

    S(c) \;\; (\text{clamp}), \qquad \prod_i \bigl(1 + (x_i - c_i) \, \partial_i\bigr) \, S(c)
    \;\; (\text{extend})

or no number at all (refuse).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_choice, check_numeric
from ocp.checks.errors import ProblemError
from ocp.expressions.spline import spline

Beyond = Literal["refuse", "extend", "clamp"]
Between = Literal["cubic", "linear"]
# How the value of a table is called in its Functions: so an expression says what it is made of.
_KINKED, _ENDING = "with_kinks", "until_the_end"
_ORDER: dict[Between, int] = {"cubic": 3, "linear": 1}
# An argument may be beyond an end by this part of the table's width: rounding, and as much as
# counts as no violation of a bound.
_MARGIN = 1e-6


@dataclass(frozen=True, eq=False)
class Table:
    """A function given by samples on a grid, to be called in dynamics, costs and constraints.

    ``Table(angles, lifts)(alpha)``, ``Table((machs, heights), drags)(mach, height)``. Its
    derivatives are exact. Cubic (not-a-knot), it is twice continuously differentiable, in all
    methods. What it costs does not grow with the number of samples.

    Args:
        knots: where the samples were taken, increasing: (n,), or for several arguments a sequence
            of such.
        values: the samples, (n,), or (n1, n2, ...).
        beyond: what holds beyond the ends. ``"refuse"``: nothing: there it is no number, and a
            trajectory that goes there is a failure which names the table; to stay within is a
            constraint, see ``ends``. ``"extend"``: it goes on in a straight line; its second
            derivative jumps at the end (smoothness 1). ``"clamp"``: it keeps the value of the end,
            where it has a kink (smoothness 0).
        between: ``"cubic"``, or ``"linear"``, which has a kink at every knot: a problem with it
            must be declared with ``smoothness=0``.
        name: what messages call it, a name as in Python.

    Raises:
        ProblemError: if there are too few knots, or they do not increase, are not finite, or do
            not fit the samples.
    """

    knots: ArrayLike | Sequence[ArrayLike]
    values: ArrayLike
    beyond: Beyond = "refuse"
    between: Between = "cubic"
    name: str = "table"

    def __repr__(self) -> str:
        """Return one line: its size, and what holds between and beyond the samples."""
        size = " x ".join(map(str, np.shape(self.values)))
        return f"<Table '{self.name}': {size} samples, {self.between}, beyond: {self.beyond}>"

    def __post_init__(self) -> None:
        """Check grid and samples."""
        if not isinstance(self.name, str) or not ca.Function.check_name(self.name):
            raise ProblemError(f"table: its name {self.name!r} is none as in Python")
        what = f"table '{self.name}'"
        check_choice(self.beyond, get_args(Beyond), f"{what}: beyond")
        check_choice(self.between, get_args(Between), f"{what}: between")
        values = check_numeric(self.values, f"{what}: values")
        given: Any = self.knots
        axes = [given] if values.ndim == 1 else _entries(given, values.ndim, what)
        knots = tuple(
            _axis(each, _axis_name(what, i, values.ndim), _ORDER[self.between] + 1)
            for i, each in enumerate(axes)
        )
        if (needed := tuple(map(len, knots))) != values.shape:
            raise ProblemError(f"{what}: values have shape {values.shape}, {needed} is needed")
        if not np.isfinite(values).all():
            at = np.argwhere(~np.isfinite(values))[0].tolist()
            raise ProblemError(f"{what}: values{at} is {values[tuple(at)]}, no finite number")
        values.flags.writeable = False
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "knots", knots[0] if values.ndim == 1 else knots)

    @property
    def axes(self) -> tuple[np.ndarray, ...]:
        """The knots along each argument."""
        values = np.asarray(self.values)
        return (np.asarray(self.knots),) if values.ndim == 1 else tuple(self.knots)  # type: ignore

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """First and last knot along each argument, as bounds of the arguments, each (d,)."""
        return np.array([k[0] for k in self.axes]), np.array([k[-1] for k in self.axes])

    def __call__(self, *arguments: Any) -> Any:
        """Return the table's value.

        Args:
            arguments: one for each axis: expressions, column by column entry, or numbers.

        Returns:
            an expression of the shape of the arguments; of numbers alone an array.

        Raises:
            ProblemError: for another number of arguments, or some of different shapes.
        """
        if len(arguments) != len(self.axes):
            raise ProblemError(
                f"table '{self.name}' takes {len(self.axes)} arguments, not {len(arguments)}"
            )
        kind = next((type(a) for a in arguments if isinstance(a, ca.SX | ca.MX)), None)
        if kind is None:
            return self._numbers(arguments)
        columns = [ca.vec(kind(a)) for a in arguments]
        if len({column.numel() for column in columns}) > 1:
            sizes = " and ".join(str(column.numel()) for column in columns)
            raise ProblemError(f"table '{self.name}': its arguments have {sizes} entries")
        rows = zip(*[ca.vertsplit(column) for column in columns], strict=True)
        return ca.vertcat(*[self._at(list(row)) for row in rows])

    def _numbers(self, arguments: Sequence[Any]) -> np.ndarray:
        what = f"table '{self.name}': argument"
        given = np.broadcast_arrays(*[check_numeric(a, what) for a in arguments])
        values = self._evaluated.map(given[0].size)(*[each.reshape(1, -1) for each in given])
        return np.array(values).reshape(given[0].shape)

    @cached_property
    def _evaluated(self) -> ca.Function:
        x = [ca.SX.sym(f"x{i}") for i in range(len(self.axes))]
        return ca.Function(self.name, x, [self._at(x)])

    def _at(self, x: list) -> Any:
        """Return the value at scalar expressions."""
        if self.beyond == "refuse" or self._goes_on:
            return self._spline(*x)
        ends = zip(x, *self.ends, strict=True)
        nearest = [ca.fmin(ca.fmax(each, low), high) for each, low, high in ends]
        if self.beyond == "clamp":
            return self._spline(*nearest)
        # Along several arguments the product of the lines along each, which has no kink.
        powers = [1.0]
        for each, end in zip(x, nearest, strict=True):
            powers += [power * (each - end) for power in powers]
        return ca.dot(ca.vertcat(*powers), ca.vertcat(*self._spline.call(nearest)))

    @property
    def _goes_on(self) -> bool:
        """Whether the outermost pieces of the spline, which go on, are the lines asked for."""
        return self.beyond == "extend" and self.between == "linear"

    @cached_property
    def _spline(self) -> ca.Function:
        """The spline; to extend it with its derivatives along 0, 1, 0 and 1, 2, ... as well."""
        x = [ca.MX.sym(f"x{i}") for i in range(len(self.axes))]
        outputs = [spline(self.axes, np.asarray(self.values), _ORDER[self.between], x)]
        if self.beyond == "refuse":
            rows = zip(x, *_with_margin(self.axes), strict=True)
            outside = [ca.logic_or(each < low, each > high) for each, low, high in rows]
            outputs = [ca.if_else(ca.sum1(ca.vertcat(*outside)), np.nan, outputs[0])]
        elif self.beyond == "extend" and not self._goes_on:
            for each in x:
                outputs += [ca.jacobian(output, each) for output in outputs]
        is_kinked, ends = self.between == "linear", self.beyond == "refuse"
        value = "_".join(["value", *[_KINKED] * is_kinked, *[_ENDING] * ends])
        names = [value, *(f"slope{i}" for i in range(1, len(outputs)))]
        inputs = [f"x{i}" for i in range(len(x))]
        return ca.Function(self.name, x, outputs, inputs, names, {"never_inline": True})


def has_kinks(function: ca.Function) -> bool:
    """Whether a function that an expression calls is a table with kinks at its knots."""
    return _KINKED in function.name_out(0)


def has_ends(function: ca.Function) -> bool:
    """Whether a function that an expression calls is a table without a value beyond its ends."""
    return _ENDING in function.name_out(0)


def _with_margin(axes: Iterable[np.ndarray]) -> tuple[list[float], list[float]]:
    """Return first and last knot along each argument, a margin beyond."""
    margins = [_MARGIN * (axis[-1] - axis[0]) for axis in axes]
    both = [(float(k[0] - m), float(k[-1] + m)) for k, m in zip(axes, margins, strict=True)]
    return [low for low, _ in both], [high for _, high in both]


def _axis_name(what: str, i: int, count: int) -> str:
    return f"{what}: knots" if count == 1 else f"{what}: knots of argument {i}"


def _entries(knots: Any, count: int, what: str) -> Sequence[ArrayLike]:
    """Return the knots along each of several arguments."""
    if not isinstance(knots, tuple | list) or len(knots) != count:
        raise ProblemError(
            f"{what}: values have {count} dimensions: its knots must be {count} arrays, one for "
            "each, as in Table((x1, x2), values)"
        )
    return knots


def _axis(given: ArrayLike, what: str, least: int) -> np.ndarray:
    """Return the knots along one argument, checked."""
    knots = check_numeric(given, what)
    if knots.ndim != 1:
        raise ProblemError(f"{what} have shape {knots.shape}, a row of numbers is needed")
    if len(knots) < least:
        raise ProblemError(f"{what} are {len(knots)}, at least {least} are needed")
    if not np.isfinite(knots).all():
        at = int(np.flatnonzero(~np.isfinite(knots))[0])
        raise ProblemError(f"{what}: entry {at} is {knots[at]}, no finite number")
    if (np.diff(knots) <= 0.0).any():
        at = int(np.flatnonzero(np.diff(knots) <= 0.0)[0]) + 1
        raise ProblemError(
            f"{what} must increase, entry {at} ({knots[at]:g}) does not: sort them with their "
            "values, each once"
        )
    knots.flags.writeable = False
    return knots
