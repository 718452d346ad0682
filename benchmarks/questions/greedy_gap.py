"""What it costs to look one step ahead only: the inequality 1.4, on all plants."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rich.table import Table

from models import lq_regulator, mass_spring_damper, stable_plant, thesis_regulator, unstable_plant
from models.textbook import van_der_pol
from ocp import OCP, Box, evaluate, solve
from solvers import Greedy, MultipleShooting

# Steps of a continuous problem, for both solvers.
_INTERVALS = 75
_STEPS = 50


def mass_regulator() -> OCP:
    """Return the plant (2.92), sampled every 0.05 s, led to rest from 1 m, with its bounds."""
    return lq_regulator(
        mass_spring_damper().sampled(0.05),
        Q=[100.0, 10.0],
        R=0.5,
        P=100.0,
        x0=[1.0, 0.0],
        horizon=_STEPS,
        control_bounds=Box(-40.0, 40.0),
        state_bounds=Box([-2.0, -np.inf], [2.0, np.inf]),
    )


PROBLEMS: dict[str, Callable[[], OCP]] = {
    "stable plant 2.50": lambda: thesis_regulator(stable_plant(), _STEPS),
    "unstable plant 2.53": lambda: thesis_regulator(unstable_plant(), _STEPS),
    "mass 2.92": mass_regulator,
    "Van der Pol": van_der_pol,
}


@dataclass(frozen=True)
class Gap:
    """Costs as the referee finds them.

    Attributes:
        problem: its name.
        greedy: cost of one step ahead.
        optimum: cost over the finite horizon.
    """

    problem: str
    greedy: float
    optimum: float

    @property
    def ratio(self) -> float:
        """How many times the optimum greedy control costs."""
        return self.greedy / self.optimum


def gap(name: str) -> Gap:
    """Solve one of the problems by both."""
    ocp = PROBLEMS[name]()
    greedy = solve(ocp, Greedy(intervals=_INTERVALS))
    optimum = solve(ocp, MultipleShooting(intervals=_INTERVALS)).or_raise()
    return Gap(name, evaluate(greedy).cost, evaluate(optimum).cost)


def greedy_table() -> Table:
    """Return the costs of all plants, and their ratios."""
    table = Table(title="greedy control against the finite-horizon optimum (1.4)")
    for column in ("problem", "greedy", "optimum", "ratio"):
        table.add_column(column, justify="left" if column == "problem" else "right")
    for name in PROBLEMS:
        found = gap(name)
        table.add_row(name, *(f"{v:.6g}" for v in (found.greedy, found.optimum, found.ratio)))
    return table
