"""Shapes that keep a distance, as constraints of a problem."""

from collections.abc import Sequence

import casadi as ca

from models.shapes.distances import distance, heights
from models.shapes.shapes import HalfSpace, Rounded, Shape
from ocp import Constraint, ProblemError
from ocp.internal import check_instance, check_real


def clearance(a: Shape, b: Shape, margin: float = 0.0, *, name: str | None = None) -> Constraint:
    """Return the path constraint that two shapes are at least a margin apart.

    It is one row, ``distance(a, b) >= margin`` [m]; of a body above a half-space one row for each
    vertex of its core, which are smooth where their minimum is not.

    Args:
        a: a shape; its pose may contain states, time, parameters and signals.
        b: another; at most one is a half-space.
        margin: [m].
        name: what messages call it; None: the kinds of both shapes.

    Raises:
        ProblemError: for what is no shape, a margin that is no number, and where both poses are
            numbers: then nothing is left to constrain.
    """
    rows = clearance_rows(a, b)
    least = check_real(margin, "clearance: margin")
    said = f"clearance of {a.kind} and {b.kind}" if name is None else name
    if not ca.symvar(rows):
        raise ProblemError(
            f"{said}: neither moves: place one by an expression in states or time, as in "
            "shape.at(x[:3])"
        )
    return Constraint(said, rows, lower=least)


def clearances(
    bodies: Sequence[Shape], obstacles: Sequence[Shape], margin: float = 0.0
) -> tuple[Constraint, ...]:
    """Return the clearance of every body from every obstacle, each a constraint with its numbers.

    Args:
        bodies: what moves.
        obstacles: what it keeps away from, at rest or moving.
        margin: [m].

    Raises:
        ProblemError: as ``clearance`` does, and where one of both is no sequence.
    """
    check_shapes(bodies, "clearances: bodies")
    check_shapes(obstacles, "clearances: obstacles")
    return tuple(
        clearance(body, obstacle, margin, name=pair_name(i, body, j, obstacle))
        for i, body in enumerate(bodies)
        for j, obstacle in enumerate(obstacles)
    )


def clearance_rows(a: Shape, b: Shape) -> ca.SX:
    """Return what is at least the margin where two shapes are clear of each other (m,) [m]."""
    for ground, body in ((a, b), (b, a)):
        if isinstance(ground, HalfSpace) and isinstance(body, Rounded):
            return heights(body, ground)
    return distance(a, b)


def pair_name(i: int, body: Shape, j: int, obstacle: Shape) -> str:
    """Return what messages call the clearance of a body and an obstacle."""
    return f"clearance of bodies[{i}] ({body.kind}) and obstacles[{j}] ({obstacle.kind})"


def check_shapes(shapes: object, what: str) -> None:
    """Refuse what is no sequence of shapes.

    Raises:
        ProblemError: naming it.
    """
    if isinstance(shapes, Shape):
        raise ProblemError(f"{what} is a {shapes.kind}; put it into a tuple: ({shapes.kind}(...),)")
    check_instance(shapes, (tuple, list), what)
    for i, shape in enumerate(shapes):  # type: ignore[arg-type] it is a tuple or a list
        check_instance(shape, Shape, f"{what}[{i}]")
