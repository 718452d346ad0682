"""Linear-quadratic problems that several tests share."""

import casadi as ca
import numpy as np

from models import tracking_ocp, unstable_plant
from ocp import OCP, Model, Parameter, Signal


def general(steps: int = 15, seed: int = 0) -> OCP:
    """Everything at once: changing matrices, drift, cross and linear terms, signals."""
    rng = np.random.default_rng(seed)
    x, u, t = ca.SX.sym("x", 3), ca.SX.sym("u", 2), ca.SX.sym("t")
    w, push = ca.SX.sym("w", 3), ca.SX.sym("push")
    a, b = rng.normal(size=(3, 3)) / 2, rng.normal(size=(3, 2))
    f = (1 + 0.2 * ca.sin(t)) * (a @ x) + b @ u + ca.vertcat(push, 0.1 * t, w[0])
    root = rng.normal(size=(5, 5))
    z = ca.vertcat(x - w, u)
    cost = ca.bilin(root @ root.T + np.eye(5), z, z) + push * x[0] + ca.cos(t) * u[1] + 3
    return OCP(
        name="general",
        model=Model(name="general", x=x, u=u, f=f, t=t, dt=0.1),
        x0=[1.0, -1.0, 0.5],
        horizon=steps,
        running_cost=cost,
        terminal_cost=7 * ca.sumsqr(x - w) + x[1] * push,
        parameters=(
            Signal("w", w, rng.normal(size=(steps + 1, 3))),
            Parameter("push", push, [0.3]),
        ),
    )


def unstable_tracking(steps: int = 20) -> OCP:
    """The plant 2.53 with the weights 2.55 behind a reference that turns."""
    reference = np.sin(0.3 * np.arange(steps + 1))[:, None] * [1.0, 0.5, -1.0]
    return tracking_ocp(
        unstable_plant(), reference, Q=100.0, R=500.0, P=10.0, x0=np.ones(3), horizon=steps
    )
