"""A robot that hits neither obstacles nor itself: rows for any problem in its joint coordinates."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models.obstacles import Obstacle
from models.robot.link_shapes import LinkShape, body_of, link_shapes, placed_shapes
from models.robot.robot import Robot
from models.robot.self_collision import (
    LinkPair,
    checked_pairs,
    self_collision_pairs,
    self_distances,
)
from models.shapes.clearance import check_shapes, clearance_rows
from models.shapes.shapes import Shape
from ocp import OCP, Constraint, ProblemError
from ocp.internal import check_instance, check_not_negative, check_numbers


def among_obstacles(
    ocp: OCP,
    robot: Robot,
    obstacles: Sequence[Shape],
    *,
    margin: float = 0.0,
    self_margin: float = 0.0,
    shapes: Mapping[str, Sequence[Shape]] | None = None,
    pairs: Sequence[LinkPair] | None = None,
    q: ca.SX | None = None,
    goal: ArrayLike | None = None,
) -> OCP:
    """Return a problem in which a robot keeps away from obstacles and from itself.

    It is the given problem with the constraints of ``robot_clearances``, and its start is checked,
    unless it is free.

    Args:
        ocp: a problem whose states begin with the joint coordinates, such as ``torque_ocp``.
        robot: that moves in it.
        obstacles: as ``robot_clearances`` takes them.
        margin: between links and obstacles [m].
        self_margin: between links [m].
        shapes: of links, in place of those of the description; see ``link_shapes``.
        pairs: of links that are kept apart; None: ``self_collision_pairs``; ``()``: none.
        q: the joint coordinates (n,) as an expression; None: the first n states.
        goal: a configuration (n,) to check as the start is; None: only the start is checked.

    Raises:
        ProblemError: naming the link and the obstacle, or the two links, that are nearer than the
            margin at the start or at the goal; and as ``robot_clearances`` does.
    """
    check_instance(ocp, OCP, "among obstacles: ocp")
    check_instance(robot, Robot, f"{ocp.name}: robot")
    if q is None and ocp.model.nx < robot.n:
        raise ProblemError(
            f"{ocp.name}: it has {ocp.model.nx} states, and {robot.name} {robot.n} joints; say "
            "with q=... what the joint coordinates are"
        )
    joints = ocp.model.x[: robot.n] if q is None else q
    added = robot_clearances(
        robot,
        joints,
        obstacles,
        margin,
        self_margin=self_margin,
        shapes=shapes,
        pairs=pairs,
    )
    found = replace(ocp, constraints=(*ocp.constraints, *added))
    start = ocp.start()
    if not ocp.has_free_start:  # else it is a guess
        _refuse_contact(found, added, "start", start, 0.0)
    if goal is not None:
        end = check_numbers(goal, robot.n, f"{ocp.name}: goal", repeat=False)
        if q is not None:
            raise ProblemError(f"{ocp.name}: a goal is checked where q is the first states alone")
        _refuse_contact(found, added, "goal", np.concatenate([end, start[robot.n :]]), 1.0)
    return found


def robot_clearances(
    robot: Robot,
    q: ca.SX,
    obstacles: Sequence[Shape],
    margin: float = 0.0,
    *,
    self_margin: float = 0.0,
    shapes: Mapping[str, Sequence[Shape]] | None = None,
    pairs: Sequence[LinkPair] | None = None,
) -> tuple[Constraint, ...]:
    r"""Return path constraints that keep a robot away from obstacles and from itself.

    .. math:: d(\text{shape of a link}, \text{obstacle}) \ge d_m, \quad
        d(\text{shape of a link}, \text{shape of another}) \ge d_s

    A constraint is one row, its name says which link and which obstacle. What the joints do not
    move gets none: the base, and a link that turns about its own axis.

    Args:
        robot: with shapes, see ``link_shapes``.
        q: its coordinates (n,), as an expression in states.
        obstacles: ``models.shapes`` in the axes of the base, at rest or moving with time,
            parameters and signals of the problem; may be empty.
        margin: d_m [m], 0 or more.
        self_margin: d_s [m], 0 or more.
        shapes: of links, in place of those of the description.
        pairs: of links that are kept apart; None: ``self_collision_pairs``; ``()``: none.

    Raises:
        ProblemError: naming what is wrong: a link that does not exist, has a mesh for a shape, or
            is one of an impossible pair; a robot without shapes; an obstacle of the plane; a
            margin below 0.
    """
    check_instance(robot, Robot, "robot clearances: robot")
    what = f"{robot.name}: clearances"
    check_instance(q, ca.SX, f"{what}: q")
    if q.shape != (robot.n, 1):
        raise ProblemError(f"{what}: q has shape {q.shape}, ({robot.n}, 1) is needed")
    check_obstacles(obstacles, f"{what}: obstacles")
    least = check_not_negative(margin, f"{what}: margin")
    apart = check_not_negative(self_margin, f"{what}: self_margin")
    found = link_shapes(robot, shapes)
    kept = self_collision_pairs(robot, shapes=shapes) if pairs is None else pairs
    chosen = checked_pairs(robot, kept, found)
    return (
        *_from_obstacles(robot, q, found, obstacles, least),
        *_from_itself(robot, q, found, chosen, apart),
    )


def _from_obstacles(
    robot: Robot,
    q: ca.SX,
    shapes: Sequence[LinkShape],
    obstacles: Sequence[Shape],
    margin: float,
) -> list[Constraint]:
    rows = [
        (f"clearance of {each.name} and obstacles[{j}] ({obstacle.kind})", row)
        for each, placed in zip(shapes, placed_shapes(robot, q, shapes), strict=True)
        if body_of(robot, each.link) >= 0
        for j, obstacle in enumerate(obstacles)
        for row in [clearance_rows(placed, obstacle)]
    ]
    return [Constraint(name, row, lower=margin) for name, row in rows if ca.depends_on(row, q)]


def _from_itself(
    robot: Robot,
    q: ca.SX,
    shapes: Sequence[LinkShape],
    pairs: Sequence[LinkPair],
    margin: float,
) -> list[Constraint]:
    return [
        Constraint(f"clearance of {a} and {b}", rows, lower=margin)
        for (a, b), rows in self_distances(robot, q, shapes, pairs).items()
        if ca.depends_on(rows, q)
    ]


def check_obstacles(obstacles: Sequence[Shape], what: str) -> None:
    """Refuse what is no shape in space.

    Raises:
        ProblemError: naming it.
    """
    if isinstance(obstacles, tuple | list):
        for i, obstacle in enumerate(obstacles):
            if isinstance(obstacle, Obstacle):
                raise ProblemError(
                    f"{what}[{i}] is a {type(obstacle).__name__} of the plane; a robot in space "
                    "needs one of models.shapes, such as Sphere, Capsule or Cuboid"
                )
    check_shapes(obstacles, what)


def _refuse_contact(
    ocp: OCP, constraints: Sequence[Constraint], what: str, x: np.ndarray, share: float
) -> None:
    """Refuse a state at which a constraint does not hold, at the start or the end of time."""
    if not constraints:
        return
    least = [ca.mmin(constraint.expression) for constraint in constraints]
    function = ca.Function("clearance", [ocp.model.x, ocp.model.t, ocp.p], [ca.vertcat(*least)])
    parameters = ocp.parameter_values().at(np.array([share]))[0]
    values = np.array(function(x, share * ocp.duration, parameters)).ravel()
    needed = np.array([np.max(np.asarray(c.lower)) for c in constraints])
    worst = int((values - needed).argmin())
    apart, margin = float(values[worst]), float(needed[worst])
    if apart < margin:
        said = f"they overlap by {-apart:.4g} m" if apart < 0.0 else f"it is {apart:.4g} m"
        raise ProblemError(
            f"{ocp.name}: {what}: {constraints[worst].name}: {said}, {margin:g} m are needed"
        )
