"""What a name of the normal form was in the problem as it was written."""

from typing import NamedTuple


class Origin(NamedTuple):
    """What a state, control or constraint that a normal form adds stands for.

    Attributes:
        name: of the constraint, peak, state, control, unknown constant or measurement it is of.
        place: where that constraint holds, in words; empty where it is none, and "definition" of an
            equation that nobody wrote.
        instant: when, of a constraint at instants [s] since the start of the horizon.
    """

    name: str
    place: str = ""
    instant: float | None = None
