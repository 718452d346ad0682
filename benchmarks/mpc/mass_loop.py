"""The mass of 2.92 in closed loop, with its bound on the position or without it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models import sinusoid, thesis_tracking
from ocp import MPC, OCP, Box, FeedbackLaw, Plant, Rollout, closed_loop, solve
from solvers import LinearMPC

DT, STEPS = 0.05, 80
LOAD = 0.1  # [N]; the mass is unstable, so little is enough
_REST = np.zeros(2)


def reference(steps: int, *, first: int = 0) -> np.ndarray:
    """Return the sinusoid of the thesis from a step on, (steps + 1, 2)."""
    return sinusoid(DT * (first + np.arange(steps + 1)))


def problem(horizon: int, *, bounded: bool) -> OCP:
    """Return (2.92) to (2.94) over some steps, without the bound on the position if wanted."""
    ocp = thesis_tracking(horizon, dt=DT)
    return ocp if bounded else replace(ocp, state_bounds=Box())


def plant(load: float = 0.0, *, bounded: bool = False) -> Plant:
    """Return the mass under a constant force [N] that no controller knows."""

    def now(t: float) -> Mapping[str, np.ndarray]:
        return {"reference": sinusoid(np.array([t]))[0]}

    return Plant(
        ocp=problem(STEPS, bounded=bounded),
        disturbance=(lambda t: [load]) if load else None,
        parameters=now,
    )


def receding(horizon: int, load: float = 0.0, *, bounded: bool = False) -> Rollout:
    """Return the loop with a receding horizon of some steps."""

    def ahead(t: float) -> Mapping[str, np.ndarray]:
        return {"reference": reference(horizon, first=round(t / DT))}

    mpc = MPC(ocp=problem(horizon, bounded=bounded), solver=LinearMPC(), dt=DT, parameters=ahead)
    return mpc.run(plant(load, bounded=bounded), _REST, STEPS * DT)


def feed_forward(load: float = 0.0, *, bounded: bool = False) -> Rollout:
    """Return the loop in which one plan for all steps is played back."""
    plan = solve(problem(STEPS, bounded=bounded), LinearMPC()).or_raise()
    law = FeedbackLaw(law=lambda x, t: plan.u[round(t / DT)])
    return closed_loop(law, plant(load, bounded=bounded), _REST, STEPS * DT, dt=DT)
