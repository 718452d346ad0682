"""The constrained tracking problem 2.92 to 2.94 in closed loop, for figures 2.10 to 2.14."""

from functools import cache
from typing import Literal

import numpy as np

from models import sinusoid, thesis_tracking
from ocp import MPC, FeedbackLaw, InputSource, Plant, Rollout, SolverError, closed_loop, solve
from solvers import LinearMPC

HORIZONS = (5, 10, 20, 40)
BOUND, LARGEST = 2.0, 40.0
# The start from rest onto a moving reference is left out of the comparison of inputs.
SETTLED = 0.5
DURATION = 8.0
ROUNDING = 1e-9


@cache
def receding(
    steps: int,
    *,
    dt: float = 0.05,
    moving: bool = True,
    duration: float = DURATION,
    form: Literal["sparse", "condensed"] = "condensed",
) -> Rollout:
    """Return a run with a receding horizon, every decision of it optimal.

    Args:
        steps: horizon N.
        dt: interval of prediction and simulation [s].
        moving: whether the reference has a velocity.
        duration: of the run [s].
        form: of the quadratic program.
    """
    ahead = dt * np.arange(steps + 1)
    mpc = MPC(
        ocp=thesis_tracking(steps, dt=dt, moving=moving),
        solver=LinearMPC(form=form),
        dt=dt,
        parameters=lambda t: {"reference": sinusoid(t + ahead, moving=moving)},
    )
    run = mpc.run(_plant(dt, moving), np.zeros(2), duration).or_raise()
    # A figure of the optimal control law has no place for another rung of the ladder.
    worse = next((d for d in run.decisions if d.source is not InputSource.OPTIMAL), None)
    if worse is not None:
        raise SolverError(f"N = {steps}, t = {worse.t:g} s: {worse.source.name}, {worse.message}")
    return run


@cache
def finite(*, dt: float = 0.05, moving: bool = True, duration: float = DURATION) -> Rollout:
    """Return the whole duration as one problem, its inputs fed forward: horizon 0 of the thesis."""
    plan = solve(thesis_tracking(round(duration / dt), dt=dt, moving=moving), LinearMPC())
    law = FeedbackLaw.following(plan.or_raise())
    return closed_loop(law, _plant(dt, moving), plan.x0, duration, dt=dt).or_raise()


def all_runs(*, moving: bool = True) -> dict[str, Rollout]:
    """Return the runs of figures 2.10 to 2.12 by their names."""
    runs = {f"N = {n}": receding(n, moving=moving) for n in HORIZONS}
    return runs | {"finite horizon": finite(moving=moving)}


def peak(run: Rollout) -> float:
    """Return the largest abs(u) after the first half second."""
    return float(np.abs(run.inputs[run.t[:-1] >= SETTLED - ROUNDING]).max())


def when(run: Rollout) -> float:
    """Return when it is that large for the first time [s]."""
    late = np.where(run.t[:-1] >= SETTLED - ROUNDING, np.abs(run.inputs[:, 0]), 0.0)
    return float(run.t[np.flatnonzero(late >= (1.0 - 1e-6) * late.max())[0]])


def _plant(dt: float, moving: bool) -> Plant:
    """Return the plant that is the model, its cost with the reference of the moment."""
    return Plant(
        ocp=thesis_tracking(1, dt=dt, moving=moving),
        parameters=lambda t: {"reference": sinusoid([t], moving=moving)[0]},
    )
