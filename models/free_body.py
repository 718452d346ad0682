"""A free rigid body that goes from one pose to another among obstacles."""

from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import vector
from models.sampling import sampled
from models.shapes.clearance import check_shapes, clearance_rows, clearances, pair_name
from models.shapes.pose import Pose
from models.shapes.shapes import HalfSpace, Shape
from ocp import OCP, Box, Constraint, Model, Parameter, ProblemError, Signal
from ocp.internal import check_positive, check_real

_PLACES = ("px", "py", "pz", "yaw", "pitch")
# Relative to a metre of the path: what a radian costs.
_METRES_PER_RADIAN = 0.3


def free_body_ocp(
    bodies: Sequence[Shape],
    obstacles: Sequence[Shape],
    *,
    start: ArrayLike,
    goal: ArrayLike,
    horizon: float,
    margin: float = 0.0,
    acceleration: float = np.inf,
    parameters: Sequence[Parameter | Signal] = (),
    t: ca.SX | None = None,
    name: str = "free body",
) -> OCP:
    r"""Return the problem of moving a body from rest to rest, clear of all obstacles.

    .. math::

        \min \int |a|^2 + \rho^2 |\alpha|^2 \, dt, \quad
        \ddot p = a, \; (\ddot\psi, \ddot\vartheta) = \alpha, \quad d_{ij} \ge d

    The position p is that of the body's frame, yaw ψ turns it about the vertical, then pitch ϑ
    about its own y axis: R = R_z(ψ) R_y(ϑ). A capsule or a drone needs no third angle. ρ = 0.3 m.

    Args:
        bodies: the parts of the body, in its frame, with numbers for poses.
        obstacles: at rest or moving with ``t``, parameters and signals.
        start: p [m], or p, yaw and pitch [m, rad]: (3,), the body does not turn, or (5,).
        goal: the same at the end.
        horizon: duration [s].
        margin: d, between every part and every obstacle [m].
        acceleration: bound on each component of a [m/s^2].
        parameters: of the problem; the obstacles may depend on them.
        t: the symbol of time [s] in the obstacles' poses.
        name: what messages call it.

    Raises:
        ProblemError: naming a part and an obstacle that overlap, or are within the margin, at the
            start or at the goal; and what is no shape, no number, or of the wrong size.
    """
    time = ca.SX.sym("t") if t is None else t
    _check_bodies(bodies, obstacles, name)
    count = np.size(start)
    if count not in (3, 5):
        raise ProblemError(
            f"{name}: start has {count} entries, 3 or 5 (with two angles) are needed"
        )
    ends = [vector(v, count, f"{name}: {w}") for v, w in ((start, "start"), (goal, "goal"))]
    duration = check_positive(horizon, f"{name}: horizon")
    least = check_real(margin, f"{name}: margin")
    limit = check_positive(acceleration, f"{name}: acceleration", finite=False)
    for place, what, at in ((ends[0], "start", 0), (ends[1], "goal", -1)):
        pose = pose_of(ca.SX(ca.DM(place)))
        for pair, rows in _pairs([body.placed(pose) for body in bodies], obstacles):
            said = f"{name}: {what}: {pair}"
            apart = sampled(rows, time, duration, parameters, said)[1][at]
            _refuse_overlap(float(apart.min()), least, said)

    x, u = ca.SX.sym("x", 2 * count), ca.SX.sym("u", count)
    moved = [body.placed(pose_of(x[:count])) for body in bodies]
    size = ca.DM([1.0] * 3 + [_METRES_PER_RADIAN] * (count - 3))
    bound = np.array([limit] * 3 + [np.inf] * (count - 3))
    return OCP(
        name=name,
        model=_model(x, u, time, count),
        x0=np.concatenate([ends[0], np.zeros(count)]),
        horizon=duration,
        running_cost=ca.sumsqr(size * u),
        control_bounds=Box(-bound, bound) if np.isfinite(limit) else Box(),
        constraints=(
            *clearances(moved, obstacles, least),
            Constraint(
                "goal", x - ca.vertcat(ca.DM(ends[1]), ca.DM.zeros(count)), 0.0, 0.0, "terminal"
            ),
        ),
        parameters=tuple(parameters),
    )


def pose_of(place: ca.SX) -> Pose:
    """Return the pose of position, yaw and pitch, (3,) or (5,) [m, rad]."""
    if place.numel() == 3:
        return Pose(position=place)
    (c, s), (cp, sp) = [(ca.cos(angle), ca.sin(angle)) for angle in ca.vertsplit(place[3:])]
    rows = [(c * cp, -s, c * sp), (s * cp, c, s * sp), (-sp, ca.SX(0), cp)]
    return Pose(ca.vertcat(*[ca.horzcat(*row) for row in rows]), place[:3])


def _model(x: ca.SX, u: ca.SX, t: ca.SX, count: int) -> Model:
    units = (("m",) * 3 + ("rad",) * 2)[:count]
    return Model(
        name=f"free body, {count} degrees of freedom",
        x=x,
        u=u,
        f=ca.vertcat(x[count:], u),
        t=t,
        x_units=(*units, *[f"{unit}/s" for unit in units]),
        u_units=tuple(f"{unit}/s^2" for unit in units),
    )


def _check_bodies(bodies: Sequence[Shape], obstacles: Sequence[Shape], name: str) -> None:
    check_shapes(bodies, f"{name}: bodies")
    check_shapes(obstacles, f"{name}: obstacles")
    if not bodies:
        raise ProblemError(f"{name}: there is no body")
    for i, body in enumerate(bodies):
        if isinstance(body, HalfSpace):
            raise ProblemError(f"{name}: bodies[{i}] is a HalfSpace, which does not move")
        if ca.symvar(ca.vertcat(ca.vec(body.pose.R), body.pose.p)):
            raise ProblemError(
                f"{name}: bodies[{i}] has an expression for a pose; place it by numbers in the "
                "body's frame"
            )


def _pairs(bodies: Sequence[Shape], obstacles: Sequence[Shape]) -> Iterator[tuple[str, ca.SX]]:
    """Yield the name and the clearance of every body and obstacle."""
    for i, body in enumerate(bodies):
        for j, obstacle in enumerate(obstacles):
            yield pair_name(i, body, j, obstacle), clearance_rows(body, obstacle)


def _refuse_overlap(apart: float, least: float, pair: str) -> None:
    if apart >= least:
        return
    said = f"they overlap by {-apart:.4g} m" if apart < 0.0 else f"it is {apart:.4g} m"
    raise ProblemError(f"{pair}: {said}, {least:g} m are needed")
