"""Obstacles from data: what a JSON file or a table says about them."""

from collections.abc import Callable, Mapping, Sequence

import casadi as ca

from models.obstacles import Capsule, Disc, Obstacle, Polygon
from ocp import ProblemError
from ocp.internal import check_instance

# The shapes and the numbers that each needs.
_SHAPES: dict[str, tuple[Callable[..., Obstacle], frozenset[str]]] = {
    "disc": (Disc, frozenset({"center", "radius"})),
    "capsule": (Capsule, frozenset({"start", "end", "radius"})),
    "polygon": (Polygon, frozenset({"corners", "radius"})),
}


def obstacles_from_data(
    rows: Sequence[Mapping[str, object]], *, t: ca.SX | None = None
) -> tuple[Obstacle, ...]:
    """Return the obstacles that rows of data describe.

    A row is ``{"shape": "disc", "center": [x, y], "radius": r}``, ``{"shape": "capsule",
    "start": [x, y], "end": [x, y], "radius": r}`` or ``{"shape": "polygon", "corners":
    [[x, y], ...], "radius": r}``, lengths in [m]. With ``"velocity": [vx, vy]`` [m/s] that is
    where it is at t = 0.

    Args:
        rows: one mapping for each obstacle, as ``json.load`` returns them.
        t: the symbol of time [s], where one has a velocity.

    Raises:
        ProblemError: naming the row and what is missing, unknown or wrong in it.
    """
    check_instance(rows, Sequence, "obstacle data: rows")
    return tuple(_obstacle(row, t, f"obstacle data: row {i}") for i, row in enumerate(rows))


def _obstacle(row: Mapping[str, object], t: ca.SX | None, what: str) -> Obstacle:
    if not isinstance(row, Mapping):
        raise ProblemError(f"{what} is a {type(row).__name__}, a mapping is needed")
    numbers = dict(row)
    shape, velocity = numbers.pop("shape", None), numbers.pop("velocity", None)
    if not isinstance(shape, str) or shape not in _SHAPES:
        raise ProblemError(f"{what}: shape = {shape!r}, none of {', '.join(_SHAPES)}")
    make, needed = _SHAPES[shape]
    wrong = needed ^ set(numbers)
    if wrong:
        raise ProblemError(
            f"{what}: a {shape} has {', '.join(sorted(needed))}; missing or unknown: "
            f"{', '.join(sorted(map(str, wrong)))}"
        )
    try:
        obstacle = make(**numbers)
        if velocity is None:
            return obstacle
        if t is None:
            raise ProblemError("it moves: pass the symbol of time t")
        return obstacle.moving(velocity, t)  # pyright: ignore[reportArgumentType]
    except ProblemError as error:
        raise ProblemError(f"{what}: {error}") from error
