"""Small problems that exercise the description; each says what is special about it."""

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint, Model, Parameter, Signal, Solution, Status

DURATION = 1.5


def pendulum(**changes) -> OCP:
    """Nonlinear, time-dependent, with a constant and signals in f, L and phi; two controls."""
    x, u, t = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("t")
    gain, held, linear = ca.SX.sym("gain"), ca.SX.sym("held"), ca.SX.sym("linear")
    rate = ca.vertcat(
        x[1] + 0.1 * u[1], -ca.sin(x[0]) - 0.3 * x[1] + u[0] + gain * ca.sin(3 * t) + held
    )
    cost = (x[0] - linear) ** 2 + u[0] ** 2 + 0.5 * u[1] ** 2 + 0.2 * held * x[1] + t * x[0]
    given = {
        "name": "pendulum",
        "model": Model(name="pendulum", x=x, u=u, f=rate, t=t),
        "x0": [0.7, -0.2],
        "horizon": DURATION,
        "running_cost": cost,
        "terminal_cost": x[0] ** 2 + gain * x[1] + linear * x[1] ** 2,
        "parameters": (
            Parameter("gain", gain, 0.8),
            Signal("held", held, [0.5, -0.5, 1.0, 0.3], hold="held"),
            Signal("linear", linear, [0.0, 0.4, -0.3, 0.2, 0.6, 0.1], hold="linear"),
        ),
    }
    return OCP(**(given | changes))


def integrator(**changes) -> OCP:
    """One state, one control, dx/dt = u, cost u^2: everything can be done by hand."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    given = {
        "name": "integrator",
        "model": Model(name="integrator", x=x, u=u, f=u),
        "x0": 0.0,
        "horizon": 1.0,
        "running_cost": u**2,
    }
    return OCP(**(given | changes))


def lag(*, x0: float = 1.0, **changes) -> OCP:
    """Discrete time: x+ = 0.5 x + u, cost sum of x^2 + u^2, end x^2, four steps of 0.1 s."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    given = {
        "name": "lag",
        "model": Model(name="lag", x=x, u=u, f=0.5 * x + u, dt=0.1),
        "x0": x0,
        "horizon": 4,
        "running_cost": x**2 + u**2,
        "terminal_cost": x**2,
    }
    return OCP(**(given | changes))


def energy() -> OCP:
    """Double integrator with least energy: u = 6 - 12 t, cost 6, costates (-12, 12 t - 6).

    H = u^2/2 + l1 v + l2 u: l1 is constant, l2 = -l1 t + c, u = -l2 = a + b t. The ends
    give a/2 + b/6 = 1 and a + b/2 = 0, so a = 6, b = -12; the cost is int (6 - 12 t)^2/2 = 6.
    """
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    return OCP(
        name="energy",
        model=Model(name="double integrator", x=x, u=u, f=ca.vertcat(x[1], u)),
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=u**2 / 2,
        constraints=(Constraint("end", x, [1.0, 0.0], [1.0, 0.0], at="terminal"),),
    )


def trajectory(ocp: OCP, u: np.ndarray, kind: str = "held", **changes) -> Solution:
    """Return a solution that has only controls; its states are a line at the start."""
    nodes = len(u) + 1 if kind == "held" else len(u)
    x0 = np.asarray(ocp.x0)
    given = {
        "problem": ocp,
        "solver": "test",
        "status": Status.ITERATION_LIMIT,
        "t": np.linspace(0.0, ocp.duration, nodes),
        "x": np.tile(x0, (nodes, 1)),
        "x0": x0,
        "costate": np.zeros((nodes, len(x0))),
        "u": np.asarray(u, dtype=float),
        "control_kind": kind,
        "cost": 0.0,
    }
    return Solution(**(given | changes))


def bounded(ocp_bounds: Box) -> OCP:
    """The integrator with bounds on its control."""
    return integrator(control_bounds=ocp_bounds)
