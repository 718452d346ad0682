"""What the recursions over bodies share: joints at q, and vectors from one body to the next."""

from dataclasses import dataclass

import casadi as ca

from models.robot.tree import Body, Tree


@dataclass(frozen=True, eq=False)
class Placed:
    r"""A body where its joint is at q, q', q''.

    Its pose in its parent is :math:`R = C R_z(\theta), \; p = c + C z \, s` with the constants C
    and c of the joint at 0, turned by θ or slid by s.

    Attributes:
        body: which.
        sine: of θ; 0 where it slides.
        cosine: of θ; 1 where it slides.
        shift: p (3,) [m].
        rate: of the joint [rad/s] or [m/s].
        acceleration: of the joint [rad/s^2] or [m/s^2].
    """

    body: Body
    sine: ca.SX
    cosine: ca.SX
    shift: ca.SX
    rate: ca.SX
    acceleration: ca.SX

    def outwards(self, vector: ca.SX) -> ca.SX:
        """Return R' v: a vector (3,) of the parent in the axes of the body."""
        x, y, z = ca.vertsplit(ca.mtimes(ca.SX(self.body.pose.rotation.T), vector))
        s, c = self.sine, self.cosine
        return ca.vertcat(c * x + s * y, c * y - s * x, z)

    def inwards(self, vector: ca.SX) -> ca.SX:
        """Return R v: a vector (3,) of the body in the axes of its parent."""
        x, y, z = ca.vertsplit(vector)
        s, c = self.sine, self.cosine
        turned = ca.vertcat(c * x - s * y, s * x + c * y, z)
        return ca.mtimes(ca.SX(self.body.pose.rotation), turned)


def placed(
    tree: Tree, q: ca.SX, v: ca.SX | None = None, a: ca.SX | None = None
) -> tuple[Placed, ...]:
    """Return all bodies at q (n,), v (n,), a (n,); at rest where v or a are not given."""
    return tuple(
        _at(body, q[k], None if v is None else v[k], None if a is None else a[k])
        for body in tree.bodies
        for k in (body.coordinate,)
    )


def _at(body: Body, q: ca.SX, v: ca.SX | None, a: ca.SX | None) -> Placed:
    zero = ca.SX(0.0)
    position = body.factor * q + body.offset
    along = ca.SX(body.pose.rotation[:, 2])
    return Placed(
        body=body,
        sine=zero if body.slides else ca.sin(position),
        cosine=ca.SX(1.0) if body.slides else ca.cos(position),
        shift=ca.SX(body.pose.translation) + (along * position if body.slides else 0.0),
        rate=zero if v is None else body.factor * v,
        acceleration=zero if a is None else body.factor * a,
    )


def gathered(tree: Tree, per_body: list[ca.SX]) -> ca.SX:
    """Return efforts of all bodies as those of the coordinates (n,): a leader feels who follow."""
    total = [ca.SX(0.0)] * tree.n
    for body, effort in zip(tree.bodies, per_body, strict=True):
        total[body.coordinate] = total[body.coordinate] + body.factor * effort
    return ca.vertcat(ca.SX(0, 1), *total)
