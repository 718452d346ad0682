"""Problems for the native solver, each with everything of one kind."""

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint, FreeTime, Model, Parameter, Signal, Unknown

X, U, T = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("t")
STIFFNESS, WIND = ca.SX.sym("stiffness"), ca.SX.sym("wind")
FORCES = ca.vertcat(X[1], U[0] - STIFFNESS * ca.sin(X[0]) + WIND * ca.cos(U[1]) + 0.1 * ca.sin(T))
MODEL = Model(name="swing", x=X, u=U, f=FORCES, t=T)
SIZE = X[0] ** 2 + 0.5 * X[1] ** 2


def swing(**changes) -> OCP:
    """A nonlinear spring in the wind, with a parameter, a signal, bounds and rows at all places."""
    given = {
        "name": "swing",
        "model": MODEL,
        "x0": [0.6, 0.3],
        "horizon": 2.0,
        "running_cost": X[0] ** 2 + U[0] ** 2 + 0.1 * U[1] ** 2 + 0.05 * ca.cos(X[1] * U[1]),
        "terminal_cost": X[1] ** 2 + 0.2 * X[0] * X[1] * T,
        "control_bounds": Box([-0.7, -2.0], [0.7, 2.0]),
        "state_bounds": Box([-2.0, -0.35], [2.0, 2.0]),
        "parameters": (
            Parameter("stiffness", STIFFNESS, 1.3),
            Signal("wind", WIND, [0.2, -0.3, 0.4]),
        ),
        "constraints": (
            Constraint("mixed", X[0] + U[0], -0.5, 0.9),
            Constraint("share", U[1] - 0.3 * U[0] * X[1], 0.0, 0.0),
            Constraint("circle", SIZE, 0.4, 0.4, at="initial"),
            Constraint("right", X[0], lower=0.1, at="initial"),
            Constraint("goal", X[0], 0.1, 0.1, at="terminal"),
            Constraint("slow", X[1] ** 2, upper=0.02, at="terminal"),
        ),
    }
    return OCP(**(given | changes))


def free_time() -> OCP:
    """A mass that is to be there soon, with its speed bounded."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    return OCP(
        name="soon",
        model=Model(name="mass", x=x, u=u, f=ca.vertcat(x[1], u - 0.1 * x[1] ** 2)),
        x0=[0.0, 0.0],
        horizon=FreeTime(guess=3.0, lower=0.5, upper=9.0),
        running_cost=1.0 + 0.3 * u**2,
        control_bounds=Box(-1.0, 1.0),
        state_bounds=Box([-1.0, -1.0], [2.0, 0.8]),
        constraints=(Constraint("there", x, [1.0, 0.0], [1.0, 0.0], at="terminal"),),
    )


def designed() -> OCP:
    """A spring whose stiffness is chosen, for a free first speed, in discrete time."""
    x = ca.vertcat(ca.SX.sym("place"), ca.SX.sym("speed"))
    u, k = ca.SX.sym("u"), ca.SX.sym("k")
    after = ca.vertcat(x[0] + 0.1 * x[1], x[1] + 0.1 * (u - k * x[0]))
    return OCP(
        name="designed",
        model=Model(name="spring", x=x, u=u, f=after, dt=0.1),
        x0=[1.0, 0.0],
        horizon=15,
        running_cost=u**2 + x[0] ** 2 + 0.01 * k**2,
        constraints=(Constraint("end", x[0], 0.2, 0.2, at="terminal"),),
        free_start=("speed",),
        start_bounds=Box([-np.inf, -0.5], [np.inf, 0.5]),
        unknowns=(Unknown("stiffness", k, 1.0, lower=0.2, upper=3.0),),
    )


def held_still() -> OCP:
    """A mass of which one control, and one state at all later nodes, have equal bounds."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 2)
    return OCP(
        name="held still",
        model=Model(name="mass", x=x, u=u, f=ca.vertcat(x[1] + u[0], u[1])),
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=u[1] ** 2 + (x[0] - 1.0) ** 2,
        control_bounds=Box([0.3, -4.0], [0.3, 4.0]),
        state_bounds=Box([-9.0, 0.0], [9.0, 0.0]),
    )


def rationed() -> OCP:
    """A mass pulled along, with rows in every stage that hold it back, and a free end."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    return OCP(
        name="rationed",
        model=Model(name="mass", x=x, u=u, f=ca.vertcat(x[1], u - 0.2 * x[1] ** 3)),
        x0=[0.0, 0.4],
        horizon=1.0,
        running_cost=u**2,
        terminal_cost=-5.0 * x[0],
        constraints=(Constraint("effort", u + x[1], upper=1.1),),
    )


def impossible() -> OCP:
    """A mass that would have to be further than its bounds let it."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    return OCP(
        name="impossible",
        model=Model(name="mass", x=x, u=u, f=ca.vertcat(x[1], u)),
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=u**2,
        control_bounds=Box(-1.0, 1.0),
        constraints=(Constraint("goal", x[0], 3.0, 3.0, at="terminal"),),
    )


def unbounded() -> OCP:
    """A cost without a minimum."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return OCP(
        name="unbounded",
        model=Model(name="mass", x=x, u=u, f=u),
        x0=[0.0],
        horizon=1.0,
        running_cost=-(u**2) - x**2,
    )
