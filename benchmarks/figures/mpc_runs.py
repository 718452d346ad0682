"""The constrained tracking problem 2.92 to 2.94 in closed loop, for figures 2.10 to 2.14."""

from functools import cache

import numpy as np

from benchmarks.closed_loop import ClosedLoop, feed_forward, receding_horizon
from models import mass_spring_damper, sinusoid, thesis_tracking
from ocp import solve
from solvers import LinearMPC

HORIZONS = (5, 10, 20, 40)
BOUND, LARGEST = 2.0, 40.0
# The start from rest onto a moving reference is left out of the comparison of inputs.
SETTLED = 0.5
DURATION = 8.0
ROUNDING = 1e-9


@cache
def receding(
    steps: int, *, dt: float = 0.05, moving: bool = True, duration: float = DURATION
) -> ClosedLoop:
    """Return a run with a receding horizon.

    Args:
        steps: horizon N.
        dt: interval of prediction and simulation [s].
        moving: whether the reference has a velocity.
        duration: of the run [s].
    """
    plant, count = mass_spring_damper().sampled(dt), round(duration / dt)
    reference = sinusoid(dt * np.arange(count + steps + 1), moving=moving)
    return receding_horizon(
        LinearMPC(form="condensed").build(thesis_tracking(steps, dt=dt, moving=moving)),
        lambda x, u: plant.A @ x + plant.B @ u,
        np.zeros(2),
        count,
        preview=lambda k: {"reference": reference[k : k + steps + 1]},
        dt=dt,
    )


@cache
def finite(*, dt: float = 0.05, moving: bool = True, duration: float = DURATION) -> ClosedLoop:
    """Return the whole duration as one problem, its inputs fed forward: horizon 0 of the thesis."""
    plant = mass_spring_damper().sampled(dt)
    ocp = thesis_tracking(round(duration / dt), dt=dt, moving=moving)
    plan = solve(ocp, LinearMPC()).or_raise()
    return feed_forward(plan, lambda x, u: plant.A @ x + plant.B @ u)


def all_runs(*, moving: bool = True) -> dict[str, ClosedLoop]:
    """Return the runs of figures 2.10 to 2.12 by their names."""
    runs = {f"N = {n}": receding(n, moving=moving) for n in HORIZONS}
    return runs | {"finite horizon": finite(moving=moving)}


def peak(loop: ClosedLoop) -> float:
    """Return the largest abs(u) after the first half second."""
    return float(np.abs(loop.u[loop.t[:-1] >= SETTLED - ROUNDING]).max())


def when(loop: ClosedLoop) -> float:
    """Return when it is that large for the first time [s]."""
    late = np.where(loop.t[:-1] >= SETTLED - ROUNDING, np.abs(loop.u[:, 0]), 0.0)
    return float(loop.t[np.flatnonzero(late >= (1.0 - 1e-6) * late.max())[0]])
