"""Which links of a robot may hit each other."""

from collections.abc import Mapping, Sequence
from itertools import combinations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models.robot.link_shapes import LinkShape, body_of, link_shapes, placed_shapes
from models.robot.robot import Robot
from models.shapes.distances import distance
from models.shapes.shapes import Shape
from ocp import ProblemError
from ocp.internal import check_instance, check_numbers

# Configurations, besides the rest pose, in which links touch that always touch; drawn from a seed.
_DRAWN, _SEED = 50, 0

LinkPair = tuple[str, str]


def self_collision_pairs(
    robot: Robot,
    *,
    shapes: Mapping[str, Sequence[Shape]] | None = None,
    rest: ArrayLike | None = None,
) -> tuple[LinkPair, ...]:
    """Return the pairs of links that have to be kept apart: a list to read, and to change.

    It has all pairs of links with shapes, except

    - links that do not move against each other, and neighbours, which share a joint,
    - links whose shapes touch in the rest pose and in 50 random configurations as well: they are
      drawn too large, and nothing can part them.

    Args:
        robot: the robot.
        shapes: of links, in place of those of the description; see ``link_shapes``.
        rest: a configuration (n,) in which nothing hits; None: the middle of the limits, 0 for a
            joint without.

    Raises:
        ProblemError: as ``link_shapes`` does, or if the rest pose has a wrong size.
    """
    all_shapes = link_shapes(robot, shapes)
    links = list(dict.fromkeys(each.link for each in all_shapes))
    apart = [pair for pair in combinations(links, 2) if _may_meet(robot, *pair)]
    if not apart:
        return ()
    lower, upper = _ranges(robot)
    middle = (lower + upper) / 2.0
    what = f"{robot.name}: rest"
    first = middle if rest is None else check_numbers(rest, robot.n, what, repeat=False)
    drawn = np.random.default_rng(_SEED).uniform(lower, upper, size=(_DRAWN, robot.n))
    q = ca.SX.sym("q", robot.n)
    least = [ca.mmin(rows) for rows in self_distances(robot, q, all_shapes, apart).values()]
    function = ca.Function("distances", [q], [ca.vertcat(*least)]).map(_DRAWN + 1)
    values = np.array(function(np.vstack([first, drawn]).T))
    return tuple(pair for pair, row in zip(apart, values, strict=True) if (row > 0.0).any())


def checked_pairs(
    robot: Robot, pairs: Sequence[LinkPair], shapes: Sequence[LinkShape]
) -> list[LinkPair]:
    """Return pairs of links that have shapes.

    Raises:
        ProblemError: naming what is no pair, a link that does not exist or has no shape, or links
            that do not move against each other.
    """
    known = list(dict.fromkeys(each.link for each in shapes))
    check_instance(pairs, (tuple, list), f"{robot.name}: pairs")
    for i, pair in enumerate(pairs):
        what = f"{robot.name}: pairs[{i}]"
        if not isinstance(pair, tuple | list) or len(pair) != 2:
            raise ProblemError(f"{what} is {pair!r}, two names of links are needed")
        for link in pair:
            if link not in known:
                raise ProblemError(
                    f"{what}: there is no link '{link}' with a shape; those are {', '.join(known)}"
                )
        if body_of(robot, pair[0]) == body_of(robot, pair[1]):
            raise ProblemError(f"{what}: {pair[0]} and {pair[1]} do not move against each other")
    return [(str(a), str(b)) for a, b in pairs]


def self_distances(
    robot: Robot, q: ca.SX, shapes: Sequence[LinkShape], pairs: Sequence[LinkPair]
) -> dict[LinkPair, ca.SX]:
    """Return, of each pair of links, the distances of all their shapes at q (k,) [m]."""
    by_link: dict[str, list[Shape]] = {}
    for each, placed in zip(shapes, placed_shapes(robot, q, shapes), strict=True):
        by_link.setdefault(each.link, []).append(placed)
    return {
        (a, b): ca.vertcat(*[distance(one, other) for one in by_link[a] for other in by_link[b]])
        for a, b in pairs
    }


def _may_meet(robot: Robot, a: str, b: str) -> bool:
    """Return whether two links move against each other and share no joint."""
    bodies = robot.tree.bodies
    i, j = body_of(robot, a), body_of(robot, b)
    parents = [bodies[k].parent if k >= 0 else None for k in (i, j)]
    return i != j and parents[0] != j and parents[1] != i


def _ranges(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return limits of all coordinates (n,) each; half a turn, or half a metre, where is none."""
    limits = robot.limits
    some = np.array([np.pi if unit == "rad" else 0.5 for unit in robot.units])
    lower = np.where(np.isfinite(limits.lower), limits.lower, -some)
    return lower, np.where(np.isfinite(limits.upper), limits.upper, some)
