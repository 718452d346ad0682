"""Problems that one method needs and the case library does not have; each says why it is there."""

from dataclasses import fields
from typing import Any

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint, FreeTime, Model, Parameter, Signal


def changed(ocp: OCP, **changes: Any) -> OCP:
    """The same problem with some of its terms replaced."""
    terms: dict[str, Any] = {f.name: getattr(ocp, f.name) for f in fields(ocp)}
    return OCP(**(terms | changes))


def point(**changes) -> OCP:
    """One state, dx/dt = u, cost u^2 from 0 in 1 s; ``x`` and ``u`` are the symbols' names."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    given: dict[str, Any] = {
        "name": "point",
        "model": Model(name="point", x=x, u=u, f=u),
        "x0": 0.0,
        "horizon": 1.0,
        "running_cost": u**2,
    }
    terms: dict[str, Any] = {
        key: value(x, u) if callable(value) else value for key, value in changes.items()
    }
    return OCP(**(given | terms))


def moving(f, *, x0: float, **changes) -> OCP:
    """One state with dx/dt = f(x, u)."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    given: dict[str, Any] = {
        "name": "moving",
        "model": Model(name="moving", x=x, u=u, f=f(x, u)),
        "x0": x0,
        "horizon": 1.0,
        "running_cost": u**2,
    }
    terms: dict[str, Any] = {
        key: value(x, u) if callable(value) else value for key, value in changes.items()
    }
    return OCP(**(given | terms))


def mass() -> Model:
    """Position and velocity, driven by an acceleration."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    return Model(name="double integrator", x=x, u=u, f=ca.vertcat(x[1], u))


def ends(value: float, name: str = "end"):
    """Terminal constraint x = value, for ``point`` and ``moving``."""
    return lambda x, u: (Constraint(name, x, value, value, at="terminal"),)


def tracker(**changes) -> OCP:
    """Everything at run time: a gain in the cost, a held drift in f, a linear reference in L."""
    x, u, t = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("t")
    gain, drift, target = ca.SX.sym("gain"), ca.SX.sym("drift"), ca.SX.sym("target")
    given: dict[str, Any] = {
        "name": "tracker",
        "model": Model(
            name="swing",
            x=x,
            u=u,
            f=ca.vertcat(x[1], -ca.sin(x[0]) + u + drift + 0.3 * ca.cos(2 * t)),
            t=t,
        ),
        "x0": [0.5, 0.0],
        "horizon": 1.2,
        "running_cost": gain * (x[0] - target) ** 2 + u**2 + 0.1 * t * x[1],
        "terminal_cost": gain * x[1] ** 2,
        "parameters": (
            Parameter("gain", gain, 2.0),
            Signal("drift", drift, [0.2, -0.4, 0.1]),
            Signal("target", target, [0.0, 0.8, -0.2, 0.4], hold="linear"),
        ),
    }
    return OCP(**(given | changes))


# Values for a second run of the tracker: another number of samples is allowed, too.
OTHER: dict[str, Any] = {"gain": 5.0, "drift": [-0.3, 0.5, 0.0], "target": [0.3, -0.5, 0.2, 0.1]}


def timed_transfer(**changes) -> OCP:
    r"""Double integrator, rest to rest over 1 m, min T + int u^2/2: T = 18^(1/4), cost 4 T / 3.

    For a given T the energy is least for u = 6/T^2 (1 - 2t/T), with int u^2/2 = 6/T^3. From
    1 - 18/T^4 = 0 follows T = 18^(1/4), and then T + 6/T^3 = T (1 + 6/T^4) = 4 T / 3. The same
    from H = 0 at t = 0, where v = 0: 1 + u^2/2 - u^2 = 0, u(0) = sqrt 2 = 6/T^2.
    """
    model = mass()
    given: dict[str, Any] = {
        "name": "timed transfer",
        "model": model,
        "x0": [0.0, 0.0],
        "horizon": FreeTime(guess=1.5, lower=0.1, upper=10.0),
        "running_cost": 1.0 + model.u**2 / 2,
        "constraints": (Constraint("end", model.x, [1.0, 0.0], [1.0, 0.0], at="terminal"),),
    }
    return OCP(**(given | changes))


TRANSFER_TIME = 18.0**0.25
TRANSFER_COST = 4.0 * TRANSFER_TIME / 3.0


def saturated_transfer(limit: float = 4.5) -> tuple[OCP, float]:
    r"""Double integrator energy with abs(u) <= m, and its optimal cost m^2 (1/2 - 2w/3).

    u is m, then linear through 0 at t = 1/2, then -m. With w the half width of the linear part
    and tau = 1/2 - t the way is 2 int_0^(1/2) tau u = 2m (w^2/3 + (1/4 - w^2)/2)
    = m/4 - m w^2/3 = 1, so w^2 = 3 (1/4 - 1/m), and the cost is m^2 (w/3 + 1/2 - w).
    """
    model = mass()
    width = np.sqrt(3.0 * (0.25 - 1.0 / limit))
    ocp = OCP(
        name="saturated transfer",
        model=model,
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=model.u**2 / 2,
        control_bounds=Box(-limit, limit),
        constraints=(Constraint("end", model.x, [1.0, 0.0], [1.0, 0.0], at="terminal"),),
    )
    return ocp, limit**2 * (0.5 - 2.0 * width / 3.0)


def quartic(**changes) -> OCP:
    """H is not quadratic in u: the minimising control is an implicit root."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    given: dict[str, Any] = {
        "name": "quartic",
        "model": Model(name="lag", x=x, u=u, f=-x + u),
        "x0": 2.0,
        "horizon": 1.5,
        "running_cost": x**2 + u**2 / 2 + u**4,
    }
    return OCP(**(given | changes))


def oscillator(duration: float, *, fixed: bool, size: int = 1) -> OCP:
    r"""The action of ``size`` equal oscillators: L = u^2/2 - x^2/2, dx/dt = u, x(0) = 0.

    x = 0 is an extremal. Neighbours obey dx'' = -dx. With a fixed end they vanish there,
    dx = sin(T - t), and again pi earlier; with a free end dcostate = -dx' vanishes there,
    dx = cos(T - t), and dx is zero pi/2 earlier. All ``size`` directions do so at once.
    """
    x, u = ca.SX.sym("x", size), ca.SX.sym("u", size)
    end = Constraint("end", x, 0.0, 0.0, at="terminal")
    return OCP(
        name="oscillator",
        model=Model(name="oscillator", x=x, u=u, f=u),
        x0=np.zeros(size),
        horizon=duration,
        running_cost=(ca.sumsqr(u) - ca.sumsqr(x)) / 2,
        constraints=(end,) if fixed else (),
    )


def circle_start(x0: tuple[float, float]) -> OCP:
    r"""Start anywhere on the unit circle, dx/dt = u, int u^2/2 + abs(x(1) - (2, 0))^2 / 2.

    From a start at distance d of the target the cost is d^2/4. Both (1, 0) and (-1, 0) are
    extremals, the nearest (cost 1/4) and the farthest (9/4) point of the circle.
    """
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 2)
    return OCP(
        name="circle start",
        model=Model(name="plane", x=x, u=u, f=u),
        x0=x0,
        horizon=1.0,
        running_cost=ca.sumsqr(u) / 2,
        terminal_cost=ca.sumsqr(x - ca.DM([2.0, 0.0])) / 2,
        constraints=(Constraint("circle", ca.sumsqr(x), 1.0, 1.0, at="initial"),),
    )


def well(depth: float = 6.0) -> OCP:
    """A pendulum whose gravity is a parameter: with 0 it is linear-quadratic."""
    x, u, gravity = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("gravity")
    return OCP(
        name="well",
        model=Model(
            name="pendulum",
            x=x,
            u=u,
            f=ca.vertcat(x[1], gravity * ca.sin(x[0]) * (1 + x[1] ** 2) + u),
        ),
        x0=[1.0, 0.0],
        horizon=2.5,
        running_cost=ca.sumsqr(x) + u**2 / 2,
        parameters=(Parameter("gravity", gravity, depth),),
    )
