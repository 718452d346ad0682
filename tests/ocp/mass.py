"""A mass on a line that is pushed from rest at 0 to rest at 1 in 1 s; tests say what else."""

from typing import Any

import casadi as ca

from ocp import OCP, Constraint, Model

POSITION, VELOCITY, FORCE, TIME = (
    ca.SX.sym(name) for name in ("position", "velocity", "force", "t")
)
MASS = Model(
    name="mass",
    x=ca.vertcat(POSITION, VELOCITY),
    u=FORCE,
    f=ca.vertcat(VELOCITY, FORCE),
    t=TIME,
)
ARRIVAL = Constraint("arrival", MASS.x, [1, 0], [1, 0], at="terminal")


def pushed(**changes: Any) -> OCP:
    """Least force, cost 6: u = 6 - 12 t."""
    given: dict[str, Any] = {
        "name": "mass",
        "model": MASS,
        "x0": [0.0, 0.0],
        "horizon": 1.0,
        "running_cost": FORCE**2 / 2,
        "constraints": (ARRIVAL,),
    }
    return OCP(**(given | changes))
