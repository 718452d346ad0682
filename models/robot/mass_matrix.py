"""The mass matrix of a robot, by composite bodies."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from models.robot.motion import Placed, placed
from models.robot.tree import Tree

# A pivot below this share of the largest entry is rounding: nothing resists there.
_NO_PIVOT = 1e-12


def composite_mass_matrix(tree: Tree, inertias: list[ca.SX], q: ca.SX) -> ca.SX:
    r"""Return M(q) (n, n), symmetric, with the kinetic energy v' M v / 2.

    Inwards, the bodies beyond a joint are one body whose pseudo-inertia is the sum of theirs,
    :math:`J_i + \sum_j T_j J_j T_j'`. Its joint with acceleration 1 and all others at rest takes
    a force and a moment, and these are carried inwards to the axes of the joints before it.

    Args:
        tree: the bodies.
        inertias: pseudo-inertia (4, 4) of each, numbers or expressions.
        q: coordinates (n,).

    Source: [Featherstone 2008], section 6.2.
    """
    chain = placed(tree, q)
    composite = list(inertias)
    matrix = [[ca.SX(0.0)] * tree.n for _ in range(tree.n)]

    def add(i: int, j: int, effort: ca.SX) -> None:
        row, column = tree.bodies[i], tree.bodies[j]
        k, m = row.coordinate, column.coordinate
        matrix[k][m] = matrix[k][m] + row.factor * column.factor * effort

    for i in reversed(range(len(chain))):
        each, j = chain[i], i
        force, moment = _accelerated(composite[i], each.body.slides)
        add(i, i, force[2] if each.body.slides else moment[2])
        while chain[j].body.parent >= 0:
            inner = chain[j].inwards(force)
            moment = chain[j].inwards(moment) + ca.cross(chain[j].shift, inner)
            force, j = inner, chain[j].body.parent
            effort = force[2] if chain[j].body.slides else moment[2]
            add(i, j, effort)
            add(j, i, effort)
        if each.body.parent >= 0:
            composite[each.body.parent] = composite[each.body.parent] + _moved(each, composite[i])
    return ca.vertcat(ca.SX(0, tree.n), *[ca.horzcat(*row) for row in matrix])


def _accelerated(inertia: ca.SX, slides: bool) -> tuple[ca.SX, ca.SX]:
    """Return force and moment that a body takes whose joint has acceleration 1, at rest."""
    x, y, mass = inertia[0, 3], inertia[1, 3], inertia[3, 3]
    if slides:
        return ca.vertcat(0.0, 0.0, mass), ca.vertcat(y, -x, 0.0)
    about = inertia[0, 0] + inertia[1, 1]
    return ca.vertcat(-y, x, 0.0), ca.vertcat(-inertia[0, 2], -inertia[1, 2], about)


def _moved(each: Placed, inertia: ca.SX) -> ca.SX:
    """Return T J T': the pseudo-inertia of a body in the frame of its parent."""
    s, c = each.sine, each.cosine
    xx, xy, xz, hx = (inertia[0, i] for i in range(4))
    yy, yz, hy = (inertia[1, i] for i in range(1, 4))
    # Turned about z; the sum of the first two moments stays.
    turned_xx = c * (c * xx - s * xy) - s * (c * xy - s * yy)
    turned_xy = s * (c * xx - s * xy) + c * (c * xy - s * yy)
    turned_yy = xx + yy - turned_xx
    rows = [
        [turned_xx, turned_xy, c * xz - s * yz],
        [turned_xy, turned_yy, s * xz + c * yz],
        [c * xz - s * yz, s * xz + c * yz, inertia[2, 2]],
    ]
    turned = ca.vertcat(*[ca.horzcat(*row) for row in rows])
    constant = ca.SX(each.body.pose.rotation)
    second = ca.mtimes([constant, turned, constant.T])
    first = ca.mtimes(constant, ca.vertcat(c * hx - s * hy, s * hx + c * hy, inertia[2, 3]))
    mass, p = inertia[3, 3], each.shift
    across = ca.mtimes(first + mass * p, p.T) + ca.mtimes(p, first.T)
    h = first + mass * p
    return ca.vertcat(ca.horzcat(second + across, h), ca.horzcat(h.T, mass))


def singular_coordinate(matrices: Sequence[np.ndarray]) -> int | None:
    """Return the coordinate that nothing resists at any place of mass matrices; None: none is."""
    shares = [_pivots(matrix) / (np.abs(matrix).max() or 1.0) for matrix in matrices]
    most = np.max(shares, axis=0)
    return int(most.argmin()) if most.min() <= _NO_PIVOT else None


def _pivots(matrix: np.ndarray) -> np.ndarray:
    """Return D (n,) of L D L'; what follows a pivot that is not positive is 0."""
    left, found = matrix.copy(), np.zeros(len(matrix))
    for i, pivot in enumerate(np.diagonal(left)):
        if pivot <= 0.0:
            break
        found[i] = pivot
        left[i + 1 :, i + 1 :] -= np.outer(left[i + 1 :, i], left[i, i + 1 :]) / pivot
    return found
