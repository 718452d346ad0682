"""What of a run is drawn, and over what: the arguments of ``plot``, checked."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ocp.checks.arguments import check_flag, check_instance
from ocp.checks.errors import ProblemError
from ocp.plotting.curve import Curve

#: Seconds in each unit of time.
TIME_UNITS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
_CONSTRAINTS = ("active", "all", "none")
# Drawn only where they are asked for.
_ON_REQUEST = ("invariant", "costate")


@dataclass(frozen=True)
class View:
    """A choice of curves, and the axis that they are drawn over.

    Args:
        variables: names of what is drawn, in this order; empty: everything but costates and
            invariants.
        against: name of the variable on the horizontal axis; ``"time"``.
        time_unit: ``"ms"``, ``"s"``, ``"min"``, ``"h"`` or ``"d"``.
        constraints: which path constraints have a panel: the ``"active"`` ones, ``"all"`` or
            ``"none"``.
        costates: whether they have panels.

    Raises:
        ProblemError: naming the argument that is wrong.
    """

    variables: Sequence[str] = ()
    against: str = "time"
    time_unit: str = "s"
    constraints: str = "active"
    costates: bool = False

    def __post_init__(self) -> None:
        """Check kinds and words."""
        if isinstance(self.variables, str) or not isinstance(self.variables, Sequence):
            raise ProblemError(
                f"plot: variables = {self.variables!r}: give their names in a tuple, "
                'such as variables=("speed",)'
            )
        for name in self.variables:
            check_instance(name, str, "plot: an entry of variables")
        check_instance(self.against, str, "plot: against")
        if self.time_unit not in TIME_UNITS:
            raise ProblemError(
                f"plot: time_unit = {self.time_unit!r} is no unit of time; "
                f"{', '.join(TIME_UNITS)} are"
            )
        if self.constraints not in _CONSTRAINTS:
            raise ProblemError(
                f"plot: constraints = {self.constraints!r}; {', '.join(_CONSTRAINTS)} are possible"
            )
        check_flag(self.costates, "plot: costates")

    def chosen(self, problem: str, curves: Sequence[Curve]) -> list[Curve]:
        """Return the curves that are drawn.

        Raises:
            ProblemError: if a name is of none of them.
        """
        if self.variables:
            return [c for name in self.variables for c in named(problem, curves, name)]
        return [curve for curve in curves if self._is_shown(curve)]

    def _is_shown(self, curve: Curve) -> bool:
        if curve.role == "constraint" and not curve.points:
            return self.constraints == "all" or (
                self.constraints == "active" and curve.touches_limit
            )
        return curve.role not in _ON_REQUEST or (self.costates and curve.role == "costate")


@dataclass(frozen=True, eq=False)
class Abscissa:
    """What is on the horizontal axis.

    Attributes:
        label: of the axis.
        t: instants [s], (K,), increasing; one may stand twice.
        values: of the axis there, (K,).
        is_time: whether it is time, and so increases.
    """

    label: str
    t: np.ndarray
    values: np.ndarray
    is_time: bool

    @classmethod
    def of(cls, view: View, problem: str, curves: Sequence[Curve]) -> "Abscissa":
        """Return time in its unit, or the curve that is named."""
        t = curves[0].t
        if view.against == "time":
            seconds = TIME_UNITS[view.time_unit]
            return cls(f"time [{view.time_unit}]", t, t / seconds, True)
        curve = named(problem, curves, view.against)[0]
        return cls(curve.label, curve.t, curve.values, False)

    def at(self, t: np.ndarray) -> np.ndarray:
        """Return the value of the axis at times t [s]; those of the curves themselves exactly."""
        if len(t) == len(self.t) and np.array_equal(t, self.t, equal_nan=True):
            return self.values
        known = np.isfinite(self.t)
        return np.interp(t, self.t[known], self.values[known])


def named(problem: str, curves: Sequence[Curve], name: str) -> list[Curve]:
    """Return the curves of a name.

    Raises:
        ProblemError: if there is none, with the names that there are.
    """
    found = [curve for curve in curves if curve.name == name]
    if not found:
        known = ", ".join(dict.fromkeys(curve.name for curve in curves))
        raise ProblemError(f"plot: '{name}' is nothing of '{problem}'; it has {known}")
    return found
