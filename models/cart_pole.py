"""A pole on a cart: its dynamics, a swing-up of known cost, and the problem that controls it."""

from dataclasses import dataclass, fields

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import vector
from ocp import OCP, Box, Constraint, Guess, Model, ProblemError
from ocp.internal import check_instance, check_not_negative, check_positive, check_real

# Weights of position, angle, velocity and angular velocity, and of the force.
_STAGE, _END, _FORCE = (1.0, 1.0, 0.1, 0.1), (100.0, 100.0, 10.0, 10.0), 0.01
# Of the cushion at the ends of the track [1/m^2].
_PRICE = 1e5


@dataclass(frozen=True)
class CartPole:
    r"""A point mass on a massless pole, hinged on a cart that a force drives along a track.

    The cart is at p, the mass at :math:`(p + l \sin θ, -l \cos θ)`: it hangs at θ = 0 and
    stands at θ = π. With kinetic and potential energy

    .. math::

        T &= \tfrac12 (m_c + m_p) \dot p^2 + m_p l \cos θ \, \dot p \dot θ
             + \tfrac12 m_p l^2 \dot θ^2, \quad V = -m_p g l \cos θ

    Lagrange's equations are

    .. math::

        (m_c + m_p) \ddot p + m_p l (\cos θ \, \ddot θ - \sin θ \, \dot θ^2) &= u \\
        \cos θ \, \ddot p + l \ddot θ + g \sin θ &= 0

    and the second, put into the first, gives

    .. math::

        \ddot p = \frac{u + m_p \sin θ (l \dot θ^2 + g \cos θ)}{m_c + m_p \sin^2 θ}, \quad
        \ddot θ = -\frac{\cos θ \, \ddot p + g \sin θ}{l},

    which is (6.1) and (6.2) of [Kelly 2017]. Nothing is simplified and there is no friction.

    Args:
        cart: its mass m_c [kg].
        pole: the point mass m_p [kg].
        length: of the pole, l [m].
        gravity: g [m/s^2]; 0 for a table.

    Raises:
        ProblemError: if a mass or the length is not positive, or gravity negative.
    """

    cart: float = 1.0
    pole: float = 0.3
    length: float = 0.5
    gravity: float = 9.81

    def __post_init__(self) -> None:
        """Check the numbers."""
        for entry in fields(self):
            name = f"cart-pole: {entry.name}"
            check = check_not_negative if entry.name == "gravity" else check_positive
            check(getattr(self, entry.name), name)

    def model(self) -> Model:
        """Return the model; state (p [m], θ [rad], their rates), control: the force [N]."""
        names = ("position", "angle", "velocity", "angular_velocity")
        x, u = ca.vertcat(*(ca.SX.sym(name) for name in names)), ca.SX.sym("force")
        _, angle, velocity, turning = ca.vertsplit(x)
        sin, cos = ca.sin(angle), ca.cos(angle)
        pulled = self.pole * sin * (self.length * turning**2 + self.gravity * cos)
        forward = (u + pulled) / (self.cart + self.pole * sin**2)
        round_hinge = -(cos * forward + self.gravity * sin) / self.length
        return Model(
            name="cart-pole",
            x=x,
            u=u,
            f=ca.vertcat(velocity, turning, forward, round_hinge),
            x_units=("m", "rad", "m/s", "rad/s"),
            u_units=("N",),
        )

    def energy(self, x: ca.SX) -> ca.SX:
        """Return T + V [J] in a state (4,), 0 at the height of the cart; kept without force."""
        _, angle, velocity, turning = ca.vertsplit(x)
        moving = (self.cart + self.pole) * velocity**2 + self.pole * (
            2.0 * self.length * ca.cos(angle) * velocity * turning + (self.length * turning) ** 2
        )
        return moving / 2.0 - self.pole * self.gravity * self.length * ca.cos(angle)


def cart_pole_swing_up(
    system: CartPole | None = None,
    *,
    distance: float = 1.0,
    horizon: float = 2.0,
    force: float = 20.0,
    track: float = 2.0,
) -> OCP:
    r"""Swing the pole up with least force squared, the cart from rest at 0 to rest at d.

    .. math::

        \min \int_0^T u^2 \, dt, \quad |u| \le u_{max}, \; |p| \le p_{max}, \quad
        (p, θ, \dot p, \dot θ): (0, 0, 0, 0) \to (d, π, 0, 0)

    The defaults are the problem of [Kelly 2017], section 6 and appendix E.1.

    From the problem's own guess direct methods end in a local optimum, 58.807667458 by
    ``polish`` to 1e-10 (no bound is active: forces up to 14.0 N, the cart up to 1.18 m away).
    A cheaper one, 57.944780307, swings the other way first; most random starts find it, see
    ``python -m benchmarks certify --case cart-pole-swing-up``.

    Args:
        system: masses and length; default: those of Kelly.
        distance: d [m].
        horizon: T [s].
        force: largest force [N]; inf: none.
        track: how far the cart may go to either side [m]; inf: any way.

    Raises:
        ProblemError: if a bound is negative, or the end lies beyond the track.
    """
    model, goal = _model(system), check_real(distance, "cart-pole: distance")
    end = [goal, np.pi, 0.0, 0.0]
    return OCP(
        name="cart-pole swing-up",
        model=model,
        x0=np.zeros(4),
        horizon=horizon,
        running_cost=model.u**2,
        control_bounds=_within(force, "force"),
        state_bounds=_on(track, distance),
        constraints=(Constraint("end", model.x, end, end, at="terminal"),),
        guess=Guess(x=np.array([np.zeros(4), end]), u=[0.0]),
    )


def cart_pole_upright(
    system: CartPole | None = None,
    *,
    distance: float = 0.0,
    horizon: float = 1.0,
    force: float = 20.0,
    track: float = 2.0,
    cushion: float = 0.0,
    stage: ArrayLike = _STAGE,
    end: ArrayLike = _END,
    effort: float = _FORCE,
) -> OCP:
    r"""Bring the pole up and keep it there: the problem of one horizon of a controller.

    .. math::

        \min \tfrac12 \tilde x(T)' S \tilde x(T) + \tfrac12 \int_0^T \tilde x' Q \tilde x + r u^2
        + w \max(0, |p| - p_{max} + c)^2 \, dt, \quad |u| \le u_{max}, \; |p| \le p_{max}

    with x̃ = x - (d, π, 0, 0), Q and S diagonal, and w = 5e4. No end is prescribed.

    Where the track is a hard bound, an optimal cart runs along it, and the smallest error of
    the model then leaves it no way back: no force stops it at once. With a cushion the price
    w alone keeps the cart away, which also serves solvers that take no state bounds:
    ``|p|`` <= p_max is then no bound of the problem any more. The second derivative jumps, so
    that the smoothness is 1.

    Args:
        system: masses and length; default: those of ``CartPole``.
        distance: d, where the cart shall stand [m].
        horizon: T [s].
        force: largest force [N]; inf: none.
        track: how far the cart may go to either side [m]; inf: any way.
        cushion: c [m]; 0: none.
        stage: diagonal of Q (4,).
        end: diagonal of S (4,).
        effort: r.

    Raises:
        ProblemError: if a bound or weight is negative, or the target lies beyond the track or
            in its cushion.
    """
    model, goal = _model(system), check_real(distance, "cart-pole: distance")
    off = model.x - ca.DM([goal, np.pi, 0.0, 0.0])
    q, s = (_weights(w, name) for w, name in ((stage, "stage"), (end, "end")))
    r = check_positive(effort, "cart-pole: effort")
    soft, on_track = check_not_negative(cushion, "cart-pole: cushion"), _on(track, distance)
    if soft and not abs(distance) <= track - soft < np.inf:
        raise ProblemError(
            f"cart-pole: with a cushion of {soft} m the track of {track} m must be finite, and "
            f"leave distance = {distance} m free"
        )
    beyond = ca.fmax(0.0, ca.fabs(model.x[0]) - (track - soft)) if soft else ca.SX(0.0)
    return OCP(
        name="cart-pole upright",
        model=model,
        x0=np.zeros(4),
        horizon=horizon,
        running_cost=(ca.dot(q, off**2) + r * model.u**2 + _PRICE * beyond**2) / 2.0,
        terminal_cost=ca.dot(s, off**2) / 2.0,
        control_bounds=_within(force, "force"),
        state_bounds=Box() if soft else on_track,
        smoothness=1 if soft else 2,
    )


def _model(system: CartPole | None) -> Model:
    if system is not None:
        check_instance(system, CartPole, "cart-pole: system")
    return (system or CartPole()).model()


def _within(force: float, what: str) -> Box:
    """Return |u| <= force; inf is allowed."""
    largest = check_not_negative(force, f"cart-pole: {what}", finite=False)
    return Box(-largest, largest)


def _on(track: float, distance: float) -> Box:
    """Return |p| <= track, for a cart that has to get to ``distance``."""
    end = abs(float(vector(distance, 1, "cart-pole: distance")[0]))
    side = float(np.asarray(_within(track, "track").upper))
    if end > side:
        raise ProblemError(f"cart-pole: distance = {distance} m is beyond the track of {side} m")
    free = np.full(3, np.inf)
    return Box([-side, *-free], [side, *free])


def _weights(values: ArrayLike, what: str) -> ca.DM:
    weights = vector(values, 4, f"cart-pole: {what}")
    if (weights < 0.0).any():
        raise ProblemError(f"cart-pole: {what} = {weights}, no weight may be negative")
    return ca.DM(weights)
