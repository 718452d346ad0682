"""The moving bodies of a robot, numbered from the base outwards: what its equations go over."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from models.robot.description import Description, Joint, Link, Mimic, Pose
from models.robot.rotations import onto_z
from ocp import ProblemError


@dataclass(frozen=True, eq=False)
class Body:
    """What moves as one: a link with all that is fixed to it.

    Its own frame has the joint's axis as z axis, whatever axis the description has: so all joints
    turn about z, or slide along it.

    Attributes:
        joint: name of the joint that moves it.
        parent: number of the body it moves against; -1: the world.
        pose: of the body in its parent where the joint is at 0.
        slides: whether the joint is prismatic.
        coordinate: which q moves it.
        factor: of q, other than 1 only for a joint that mimics.
        offset: added to it.
        damping: viscous friction at the joint [N m s/rad] or [N s/m].
        friction: Coulomb friction at it [N m] or [N].
        inertia: pseudo-inertia (4, 4) in the frame of the body.
    """

    joint: str
    parent: int
    pose: Pose
    slides: bool
    coordinate: int
    factor: float
    offset: float
    damping: float
    friction: float
    inertia: np.ndarray


@dataclass(frozen=True, eq=False)
class Tree:
    """A robot as numbered bodies; a parent has a lower number than its children.

    Attributes:
        bodies: what moves.
        joints: those that move by themselves, one a coordinate of q, in this order.
        frames: by the name of each link its body and its pose in it.
    """

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    frames: dict[str, tuple[int, Pose]]

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.joints)

    def inwards(self, body: int | None) -> Iterator[int]:
        """Return a body and all that it hangs on, the base not included; of None nothing."""
        at = -1 if body is None else body
        while at >= 0:
            yield at
            at = self.bodies[at].parent

    def inertias(self, *, regrouped: bool = True) -> list[np.ndarray]:
        r"""Return the pseudo-inertia (4, 4) of each body in its own frame.

        Args:
            regrouped: whether masses are moved to where they cost least. A turning joint does not
                feel point masses on its axis: they may as well belong to its parent. So each body
                hands on masses with the same m, m z and integral of z^2 dm (some negative), and
                keeps zeros. Torques, and what follows from them, are the same for all q
                [Gautier & Khalil 1990]; the forces that a bearing transmits are not.
        """
        found = [body.inertia.copy() for body in self.bodies]
        for i in reversed(range(len(found)) if regrouped else ()):
            body = self.bodies[i]
            if body.slides:
                continue
            on_axis = np.zeros((4, 4))
            on_axis[2:, 2:] = found[i][2:, 2:]
            found[i] -= on_axis
            if body.parent >= 0:
                place = homogeneous(body.pose)
                found[body.parent] += place @ on_axis @ place.T
        return found


def homogeneous(pose: Pose) -> np.ndarray:
    """Return the matrix (4, 4) that moves (r, 1)."""
    return np.block([[pose.rotation, pose.translation[:, None]], [np.zeros((1, 3)), np.eye(1)]])


def tree_of(description: Description) -> Tree:
    """Return the bodies of a description.

    Raises:
        ProblemError: naming the link or joint: a name twice, a link that is not there, with two
            parents, or in a loop; several links without a parent; a mimic of nothing.
    """
    joints = dict(_outwards(description))
    own = [joint for joint in joints.values() if joint.type != "fixed" and joint.mimic is None]
    coordinate = {joint.name: i for i, joint in enumerate(own)}
    links = {link.name: link for link in description.links}
    root = next(name for name in links if name not in joints)
    frames: dict[str, tuple[int, Pose]] = {root: (-1, Pose.identity())}
    bodies: list[Body] = []
    for name, joint in joints.items():
        parent, pose = frames[joint.parent]
        pose = pose @ joint.origin
        if joint.type == "fixed":
            frames[name] = parent, pose
            continue
        turned = Pose(onto_z(joint.axis), np.zeros(3))
        follows = _followed(joint, joints)
        bodies.append(
            Body(
                joint=joint.name,
                parent=parent,
                pose=pose @ turned,
                slides=joint.type == "prismatic",
                coordinate=coordinate[follows.joint],
                factor=follows.multiplier,
                offset=follows.offset,
                damping=joint.damping,
                friction=joint.friction,
                inertia=np.zeros((4, 4)),
            )
        )
        frames[name] = len(bodies) - 1, turned.inverse
    return Tree(_with_masses(bodies, frames, links), tuple(own), frames)


def _outwards(description: Description) -> Iterator[tuple[str, Joint]]:
    """Return each joint with its child, parents first; siblings as in the file."""
    for kind, names in (
        ("link", [link.name for link in description.links]),
        ("joint", [joint.name for joint in description.joints]),
    ):
        for name in names:
            if names.count(name) > 1:
                raise ProblemError(f"{description.name}: two {kind}s are called '{name}'")
    links = [link.name for link in description.links]
    moved_by: dict[str, Joint] = {}
    for joint in description.joints:
        for side, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                raise ProblemError(
                    f"{description.name}: joint '{joint.name}': its {side}, link '{link}', is "
                    "not in the description"
                )
        if joint.child in moved_by:
            raise ProblemError(
                f"{description.name}: link '{joint.child}' has two parents, by joint "
                f"'{moved_by[joint.child].name}' and by joint '{joint.name}': a closed loop is "
                "no tree; cut it, and close it by a constraint"
            )
        moved_by[joint.child] = joint
    roots = [name for name in links if name not in moved_by]
    if len(roots) > 1:
        raise ProblemError(
            f"{description.name}: links '{roots[0]}' and '{roots[1]}' both have no parent: join "
            "them, by a fixed joint"
        )
    reached = list(_below(roots, description.joints))
    if len(reached) < len(moved_by):
        lost = next(name for name in moved_by if name not in dict(reached))
        raise ProblemError(
            f"{description.name}: link '{lost}' hangs, by joint '{moved_by[lost].name}', on "
            "itself: a loop without a base"
        )
    yield from reached


def _below(roots: list[str], joints: tuple[Joint, ...]) -> Iterator[tuple[str, Joint]]:
    """Return what hangs on links, depth first; by a stack, for chains of any length."""
    waiting = [joint for root in roots for joint in joints if joint.parent == root][::-1]
    while waiting:
        joint = waiting.pop()
        yield joint.child, joint
        waiting += [other for other in joints if other.parent == joint.child][::-1]


def _followed(joint: Joint, joints: dict[str, Joint]) -> Mimic:
    """Return which joint moves this one at last, and how: itself, or what it mimics."""
    named = {other.name: other for other in joints.values()}
    factor, offset, at, seen = 1.0, 0.0, joint, [joint.name]
    while at.mimic is not None:
        factor, offset = factor * at.mimic.multiplier, offset + factor * at.mimic.offset
        if at.mimic.joint not in named:
            raise ProblemError(
                f"joint '{at.name}' mimics joint '{at.mimic.joint}', which is not there"
            )
        at = named[at.mimic.joint]
        if at.name in seen:
            raise ProblemError(f"joint '{joint.name}' mimics itself, by {' and '.join(seen)}")
        if at.type == "fixed":
            raise ProblemError(f"joint '{joint.name}' mimics joint '{at.name}', which is fixed")
        seen.append(at.name)
    return Mimic(at.name, factor, offset)


def _with_masses(
    bodies: list[Body], frames: dict[str, tuple[int, Pose]], links: dict[str, Link]
) -> tuple[Body, ...]:
    """Return the bodies with all links that are fixed to them."""
    total = [body.inertia.copy() for body in bodies]
    for name, (i, pose) in frames.items():
        inertia = links[name].inertia
        if i >= 0 and inertia is not None:
            place = homogeneous(pose)
            total[i] += place @ inertia.pseudo_inertia @ place.T
    return tuple(replace(body, inertia=each) for body, each in zip(bodies, total, strict=True))
