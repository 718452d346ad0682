"""The method ``plot`` of solutions, with phases or without: its options stand here once."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, Self

from ocp.plotting.compare import compared
from ocp.plotting.plottable import Pictured
from ocp.plotting.view import View

if TYPE_CHECKING:
    from ocp.plotting.picture import Picture


class Plottable(ABC):
    """What has that method."""

    #: What it is, in words.
    _called: ClassVar[str]

    @property
    @abstractmethod
    def _pictured(self) -> Pictured:
        """What a picture says of it."""

    def plot(
        self,
        variables: Sequence[str] = (),
        *,
        compare: "Self | Mapping[str, Self] | None" = None,
        against: str = "time",
        time_unit: str = "s",
        constraints: str = "active",
        costates: bool = False,
        plane: Sequence[str] | None = None,
    ) -> "Picture":
        """Return a picture: a panel for each variable, with its bounds, references and data.

        Variables with the same unit and a like size share a panel. Limits are hatched; path
        constraints of a single variable are limits of it, others have panels of their own. A
        signal that the running cost compares with a variable is drawn as its reference.

        Phases follow one after another, shaded in turn and named. What has the same name in two of
        them is one curve, with the limits that each of them has.

        Args:
            variables: names of what is drawn, in this order: states, algebraic variables,
                controls, ``"rate of u"``, signals, constraints, measurements, invariants, or
                costates ``"∂J/∂(x)"``. Empty: everything but costates and invariants.
            compare: another solution, or several by name: ``{"warm": other}``. Their problems
                may differ, the names of their states and controls may not.
            against: name of what is on the horizontal axis.
            time_unit: ``"ms"``, ``"s"``, ``"min"``, ``"h"`` or ``"d"``.
            constraints: which path constraints have a panel: the ``"active"`` ones, that is those
                that come to a limit, ``"all"`` or ``"none"``.
            costates: whether they are drawn as well.
            plane: two names ``(x, y)``: one picture of y over x instead, a phase plane.

        Returns:
            a matplotlib ``Figure``; ``picture["speed"]`` are the axes that show the speed. The
            cost in its title is the solver's own; only ``evaluate`` says what the controls do.

        Raises:
            ProblemError: if a name is of nothing, a unit is none, or problems do not compare.
        """
        # matplotlib takes a second to import: only who plots waits
        from ocp.plotting.plot import plot

        view = View(variables, against, time_unit, constraints, costates)
        shown = compared(self, compare, type(self), self._called)
        return plot({label: s._pictured for label, s in shown.items()}, view, plane)
