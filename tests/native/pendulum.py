"""A pendulum in the wind, for runs that begin warm: with bounds, a parameter and a signal."""

import casadi as ca

from ocp import OCP, Box, Model, Parameter, Signal
from ocp.internal import scaled

# What states and controls of the pendulum in other units are multiplied by.
LARGE, SMALL = 1e4, 1e-3
X, U, PULL, WIND = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("pull"), ca.SX.sym("wind")


def pushed(**changes) -> OCP:
    """A pendulum in the wind, with bounds that matter, a parameter and a signal."""
    given = {
        "name": "pushed",
        "model": Model(
            name="pendulum", x=X, u=U, f=ca.vertcat(X[1], U + PULL * ca.sin(X[0]) + WIND)
        ),
        "x0": [0.8, 0.0],
        "horizon": 1.5,
        "running_cost": X[0] ** 2 + 0.1 * X[1] ** 2 + 0.05 * U**2,
        "control_bounds": Box(-2.5, 2.5),
        "state_bounds": Box([-2.0, -0.9], [2.0, 2.0]),
        "parameters": (Parameter("pull", PULL, 1.2), Signal("wind", WIND, [0.1, -0.2, 0.3])),
    }
    return OCP(**(given | changes))


def in_large_numbers() -> OCP:
    """The pendulum in units in which its numbers are huge and tiny."""
    ocp = pushed(
        model=Model(
            name="far", x=X, u=U, f=ca.vertcat(X[1], LARGE * U / SMALL + PULL * X[0] + LARGE * WIND)
        ),
        x0=[0.8 * LARGE, 0.0],
        running_cost=(X[0] / LARGE) ** 2 + 0.1 * (X[1] / LARGE) ** 2 + 0.05 * (U / SMALL) ** 2,
        control_bounds=Box(-2.5 * SMALL, 2.5 * SMALL),
        state_bounds=Box([-2.0 * LARGE, -0.9 * LARGE], [2.0 * LARGE, 2.0 * LARGE]),
    )
    assert scaled(ocp) is not None
    return ocp
