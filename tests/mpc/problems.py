"""A cart with bounded force, and solvers that fail on demand."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, Box, Constraint, Model, Program, Solution, Solver, Start
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
class Scripted(Solver):
    """A good solver whose answers are changed from time to time.

    Args:
        script: t0 [s], rounded to two digits -> what happens to the answer then; it may raise.
    """

    script: Mapping[float, Change] = field(default_factory=dict)
    inner: Solver = field(default_factory=lambda: MultipleShooting(10))

    def build(self, ocp: OCP) -> "ScriptedProgram":
        return ScriptedProgram(self, self.inner.build(ocp))


@dataclass(frozen=True, eq=False)
class ScriptedProgram(Program):
    solver: Scripted
    inner: Program

    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: Start | None = None,
    ) -> Solution:
        solution = self.inner.run(x0=x0, t0=t0, parameters=parameters, guess=guess)
        change = self.solver.script.get(round(t0, 2))
        return change(solution) if change else solution


def is_an_input(u: np.ndarray) -> bool:
    return bool(np.isfinite(u).all() and (np.abs(u) <= LIMIT).all())
