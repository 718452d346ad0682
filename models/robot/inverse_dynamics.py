"""The torques that a motion takes, by the recursion of Newton and Euler."""

import casadi as ca
import numpy as np

from models.robot.motion import Placed, gathered, placed
from models.robot.tree import Tree


def newton_euler(
    tree: Tree,
    inertias: list[ca.SX],
    q: ca.SX,
    v: ca.SX,
    a: ca.SX | None,
    gravity: np.ndarray,
) -> ca.SX:
    r"""Return the efforts (n,) [N m] or [N] that move a robot of rigid bodies with q'' = a.

    Outwards, in the axes of each body, with the velocity field r' = ... and the acceleration
    :math:`\ddot r = b + \Gamma r` of its points,

    .. math:: \Gamma = [\dot\omega]_\times + [\omega]_\times^2

    where b is that of its origin less gravity. With the moments m, h, S of its mass (the blocks
    of the pseudo-inertia) force and moment about the origin are

    .. math:: f = m b + \Gamma h, \quad n = h \times b + (\Gamma S - (\Gamma S)')^\vee

    and inwards those of all bodies beyond add up; a joint gives what is along its axis.

    Args:
        tree: the bodies.
        inertias: pseudo-inertia (4, 4) of each, numbers or expressions.
        q: coordinates (n,).
        v: their rates (n,).
        a: their accelerations (n,); None: none.
        gravity: (3,) [m/s^2].

    Source: [Luh, Walker & Paul 1980]; with pseudo-inertias [Khalil & Kleinfinger 1987].
    """
    zero = ca.SX(np.zeros(3))
    base = (zero, ca.SX(-gravity), ca.SX(np.zeros((3, 3))))
    chain = placed(tree, q, v, a)
    moving: list[tuple[ca.SX, ca.SX, ca.SX]] = []
    turning: list[ca.SX] = []  # ω' of each body
    force, moment = [], []
    for i, each in enumerate(chain):
        parent = each.body.parent
        outer = moving[parent] if parent >= 0 else base
        spin = turning[parent] if parent >= 0 else zero
        omega, rate_of_omega, b = _next(each, outer, spin)
        field = _field(omega, rate_of_omega)
        moving.append((omega, b, field))
        turning.append(rate_of_omega)
        f, n = _wrench(inertias[i], b, field)
        force.append(f)
        moment.append(n)
    efforts = [ca.SX(0.0)] * len(chain)
    for i in reversed(range(len(chain))):
        each = chain[i]
        efforts[i] = force[i][2] if each.body.slides else moment[i][2]
        if each.body.parent >= 0:
            f = each.inwards(force[i])
            force[each.body.parent] += f
            moment[each.body.parent] += each.inwards(moment[i]) + ca.cross(each.shift, f)
    return gathered(tree, efforts)


def _next(
    each: Placed, outer: tuple[ca.SX, ca.SX, ca.SX], spin: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return ω, ω' and the acceleration of the origin of a body, in its axes."""
    omega, b, field = outer
    inner = each.outwards(omega)
    rate = each.outwards(spin)
    origin = each.outwards(b + ca.mtimes(field, each.shift))
    x, y, z = ca.vertsplit(inner)
    swept = ca.vertcat(y * each.rate, -x * each.rate, each.acceleration)
    if each.body.slides:  # 2 ω x (z s') + z s''
        return inner, rate, origin + ca.vertcat(2.0 * swept[:2], swept[2])
    return ca.vertcat(x, y, z + each.rate), rate + swept, origin


def _field(omega: ca.SX, rate: ca.SX) -> ca.SX:
    """Return [ω']x + [ω]x^2 (3, 3)."""
    x, y, z = ca.vertsplit(omega)
    dx, dy, dz = ca.vertsplit(rate)
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    return ca.vertcat(
        ca.horzcat(-(yy + zz), xy - dz, xz + dy),
        ca.horzcat(xy + dz, -(xx + zz), yz - dx),
        ca.horzcat(xz - dy, yz + dx, -(xx + yy)),
    )


def _wrench(inertia: ca.SX, b: ca.SX, field: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return force and moment about the origin that move a body."""
    h, mass = inertia[:3, 3], inertia[3, 3]
    moved = ca.mtimes(field, inertia[:3, :3])
    twist = ca.vertcat(
        moved[2, 1] - moved[1, 2], moved[0, 2] - moved[2, 0], moved[1, 0] - moved[0, 1]
    )
    return mass * b + ca.mtimes(field, h), ca.cross(h, b) + twist
