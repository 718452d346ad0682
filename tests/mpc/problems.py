"""A cart with bounded force, and a solver that fails on demand."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from benchmarks.mpc.altered import Altered
from ocp import OCP, Box, Constraint, Model, Solution
from solvers import MultipleShooting

LIMIT, FASTEST = 2.0, 1.5


def cart(*, horizon: float = 1.0, mass: float = 1.0) -> OCP:
    """A cart of 1 kg that has to come to rest at 0; |force| <= 2 N, |speed| <= 1.5 m/s."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    model = Model(name="cart", x=x, u=u, f=ca.vertcat(x[1], u / mass))
    return OCP(
        name="cart",
        model=model,
        x0=[1.0, 0.0],
        horizon=horizon,
        running_cost=10.0 * x[0] ** 2 + x[1] ** 2 + 0.1 * u**2,
        terminal_cost=20.0 * x[0] ** 2 + 5.0 * x[1] ** 2,
        control_bounds=Box(-LIMIT, LIMIT),
        constraints=(Constraint("speed", x[1], -FASTEST, FASTEST),),
    )


Change = Callable[[Solution], Solution]


@dataclass(frozen=True)
class Script:
    """What happens to answers from time to time: t0 [s], rounded to two digits -> a change."""

    changes: Mapping[float, Change]

    def __call__(self, solution: Solution, t0: float) -> Solution:
        change = self.changes.get(round(t0, 2))
        return change(solution) if change else solution


def scripted(changes: Mapping[float, Change]) -> Altered:
    """A good solver that does as the script says, raising included."""
    return Altered(MultipleShooting(10), Script(changes))


def is_an_input(u: np.ndarray) -> bool:
    return bool(np.isfinite(u).all() and (np.abs(u) <= LIMIT).all())
