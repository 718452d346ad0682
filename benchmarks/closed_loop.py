"""A controller in the loop with a plant, and the same plant run ahead without feedback."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ocp import Program, Solution

PlantStep = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """What happened.

    Attributes:
        t: instants [s], (K + 1,).
        x: states of the plant (K + 1, nx).
        u: controls applied (K, nu).
        solutions: what the controller planned at every step (K,).
    """

    t: np.ndarray
    x: np.ndarray
    u: np.ndarray
    solutions: tuple[Solution, ...]


def receding_horizon(
    program: Program,
    plant_step: PlantStep,
    x0: ArrayLike,
    steps: int,
    *,
    preview: Callable[[int], Mapping[str, ArrayLike]] = lambda step: {},
    dt: float = 1.0,
) -> ClosedLoop:
    """Solve, apply the first control, measure, and again.

    Args:
        program: a built discrete-time problem.
        plant_step: (x, u) -> next state.
        x0: first state (nx,).
        steps: how often.
        preview: step -> parameters of the run that starts there, such as the reference ahead.
        dt: step [s].

    Raises:
        SolverError: naming what cannot be met where a solve fails; no control is made up.
    """
    x, solutions = [np.asarray(x0, dtype=float)], []
    for k in range(steps):
        plan = program.run(x0=x[-1], t0=k * dt, parameters=preview(k)).or_raise()
        solutions.append(plan)
        x.append(plant_step(x[-1], plan.u[0]))
    u = np.array([plan.u[0] for plan in solutions])
    return ClosedLoop(dt * np.arange(steps + 1), np.array(x), u, tuple(solutions))


def feed_forward(solution: Solution, plant_step: PlantStep) -> ClosedLoop:
    """Apply a finite-horizon solution as it is: the thesis' horizon 0."""
    x = [solution.x0]
    for u in solution.u:
        x.append(plant_step(x[-1], u))
    return ClosedLoop(solution.t, np.array(x), solution.u, (solution,))
