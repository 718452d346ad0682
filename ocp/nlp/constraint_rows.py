"""The rows of a nonlinear program: what each one says, and which is violated most."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ocp.problem.constraint import Constraint, Place


@dataclass(frozen=True)
class ConstraintRow:
    """What one row of the constraints says, for messages and bounds.

    Attributes:
        name: of the constraint, of a state's dynamics, or of an unknown's bound.
        place: what kind of condition it is.
        node: where on the grid it holds, 0 to N.
        lower: least value.
        upper: largest value.
    """

    name: str
    place: Literal["dynamics", "time"] | Place
    node: int
    lower: float
    upper: float

    @property
    def is_equation(self) -> bool:
        """Whether the row is an equation."""
        return self.lower == self.upper


def rows_of(constraints: Iterable[Constraint], place: Place) -> list[ConstraintRow]:
    """Return the rows of constraints, one for each component, at node 0.

    Args:
        constraints: in their order in g.
        place: where all of them hold.
    """
    return [
        ConstraintRow(c.name, place, 0, float(low), float(high))
        for c in constraints
        for low, high in zip(np.asarray(c.lower), np.asarray(c.upper), strict=True)
    ]


def most_violated(
    w: np.ndarray,
    g: np.ndarray,
    bounds: dict[str, np.ndarray],
    rows: Sequence[ConstraintRow],
    bound: Callable[[int], ConstraintRow],
) -> tuple[float, ConstraintRow | None]:
    """Return the largest violation of any row or bound, and which it is; 0 and None if none is.

    Args:
        w: unknowns (size,).
        g: values of the rows (m,).
        bounds: lbx and ubx (size,), lbg and ubg (m,).
        rows: what each value of g says.
        bound: what the bound of the i-th unknown says.
    """
    in_g = np.maximum(bounds["lbg"] - g, g - bounds["ubg"])
    in_w = np.maximum(bounds["lbx"] - w, w - bounds["ubx"])
    if max(in_g.max(initial=0.0), in_w.max(initial=0.0)) <= 0.0:
        return 0.0, None
    if in_g.max(initial=0.0) >= in_w.max():
        return float(in_g.max()), rows[int(in_g.argmax())]
    return float(in_w.max()), bound(int(in_w.argmax()))
