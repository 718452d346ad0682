"""The plants of this package's tests."""

import casadi as ca
import numpy as np
from scipy.linalg import expm

from ocp import OCP, Box, Constraint, Model, Signal

DT = 0.05


def unstable_mass(steps: int = 20, **changes) -> OCP:
    """Thesis 2.92 to 2.94 with k = -2, c = 1, m = 1, sampled exactly with 0.05 s."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    rate = np.array([[0.0, 1.0, 0.0], [2.0, -1.0, 1.0], [0.0, 0.0, 0.0]])
    sampled = expm(rate * DT)
    f = ca.DM(sampled[:2, :2]) @ x + ca.DM(sampled[:2, 2]) * u
    given = {
        "name": "unstable mass",
        "model": Model(name="unstable mass", x=x, u=u, f=f, dt=DT),
        "x0": [1.0, 0.0],
        "horizon": steps,
        "running_cost": 100 * x[0] ** 2 + 10 * x[1] ** 2 + 0.5 * u**2,
        "terminal_cost": 100 * ca.sumsqr(x),
        "state_bounds": Box([-2.0, -np.inf], [2.0, np.inf]),
        "control_bounds": Box(-40.0, 40.0),
    }
    return OCP(**(given | changes))


def line(name: str, a: float) -> Model:
    """x+ = a x + u."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return Model(name=name, x=x, u=u, f=a * x + u, dt=1.0)


def scalar(steps: int = 5, **changes) -> OCP:
    """x+ = 0.9 x + u, cost sum x^2 + u^2, end x^2; the Riccati recursion solves it."""
    model = changes.get("model") or line("scalar", 0.9)
    x, u = model.x, model.u
    given = {
        "name": "scalar",
        "model": model,
        "x0": 1.0,
        "horizon": steps,
        "running_cost": x**2 + u**2,
        "terminal_cost": x**2,
        "state_bounds": Box(-2.0, 2.0),
        "control_bounds": Box(-2.0, 2.0),
    }
    return OCP(**(given | changes))


def scalar_cost(steps: int) -> float:
    """p_0 of the scalar problem: p = 1 + 0.81 p - (0.9 p)^2 / (1 + p), from p_N = 1."""
    p = 1.0
    for _ in range(steps):
        p = 1.0 + 0.81 * p - (0.9 * p) ** 2 / (1.0 + p)
    return p


def walk(steps: int = 3, **changes) -> OCP:
    """x+ = x + u with abs(u) <= 1, from anywhere to abs(x) <= 1: reachable sets by hand."""
    model = changes.get("model") or line("walk", 1.0)
    x, u = model.x, model.u
    given = {
        "name": "walk",
        "model": model,
        "x0": 2.0,
        "horizon": steps,
        "running_cost": u**2,
        "state_bounds": Box(-6.0, 6.0),
        "control_bounds": Box(-1.0, 1.0),
        "constraints": (Constraint("home", x, -1.0, 1.0, at="terminal"),),
    }
    return OCP(**(given | changes))


def tracking(steps: int = 6) -> OCP:
    """A plant and a cost that depend on time, on a held and on a linear signal."""
    x, u, t = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("t")
    w, v = ca.SX.sym("w"), ca.SX.sym("v")
    ramp = np.linspace(0.0, 1.0, steps + 1)
    return OCP(
        name="tracking",
        model=Model(name="tracking", x=x, u=u, t=t, f=x + 0.3 * u + 0.1 * ca.sin(t) * v),
        x0=0.0,
        horizon=1.5,
        running_cost=(x - w) ** 2 + 0.1 * u**2,
        terminal_cost=(x - w) ** 2,
        state_bounds=Box(-3.0, 3.0),
        control_bounds=Box(-8.0, 8.0),
        parameters=(Signal("w", w, np.sin(4 * ramp), hold="linear"), Signal("v", v, ramp)),
    )
