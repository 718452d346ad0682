"""Fig. 2.3 and 2.4: the batch approach and the recursive one, on both plants of 2.1.4."""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from benchmarks.figures.drawing import COLOURS, FINITE, Drawing, held, label, sheet
from models import LinearPlant, stable_plant, thesis_regulator, unstable_plant
from ocp import FeedbackLaw, Plant, Rollout, closed_loop, solve
from solvers import Batch, Riccati

_STEPS = 50
_DRAWN = 2.5  # [s]; at rest afterwards


class _Pair(NamedTuple):
    name: str
    batch: Rollout
    recursive: Rollout
    cost: float
    worst: float


def states() -> Drawing:
    """Draw the states of both plants under both controllers."""
    picture, columns = sheet(11.0, 5.2), {}
    for axes, pair in zip(picture.subplots(1, 2), _pairs(), strict=True):
        for i in range(3):
            axes.plot(pair.batch.t, pair.batch.x[:, i], color=COLOURS[i], lw=3.5, alpha=0.45,
                      label=f"x_{i + 1}, batch, fed forward")  # fmt: skip
            axes.plot(pair.recursive.t, pair.recursive.x[:, i], "--", color=COLOURS[i],
                      label=f"x_{i + 1}, recursive, fed back")  # fmt: skip
        label(axes, "time [s]", "states", pair.name)
        axes.set_xlim(0.0, _DRAWN)
        axes.legend(fontsize=8)
        columns |= _columns(pair, "x", lambda loop: loop.x)
    return Drawing(picture, columns, _sentence("2.3", "states"))


def inputs() -> Drawing:
    """Draw the inputs of both plants under both controllers."""
    picture, columns = sheet(11.0, 4.6), {}
    for axes, pair in zip(picture.subplots(1, 2), _pairs(), strict=True):
        _both_inputs(axes, pair)
        label(axes, "time [s]", "input u", pair.name)
        axes.set_xlim(0.0, _DRAWN)
        axes.legend(fontsize=8)
        columns |= _columns(pair, "u", lambda loop: loop.inputs)
    return Drawing(picture, columns, _sentence("2.4", "inputs"))


def _both_inputs(axes: Axes, pair: _Pair) -> None:
    t = pair.batch.t
    held(axes, t, pair.batch.inputs[:, 0], color=COLOURS[1], lw=3.5, alpha=0.5, label="batch, 2.13")
    held(axes, t, pair.recursive.inputs[:, 0], color=FINITE, ls="--", label="recursive, 2.47")


@cache
def _pairs() -> tuple[_Pair, _Pair]:
    return _pair(stable_plant()), _pair(unstable_plant())


def _pair(plant: LinearPlant) -> _Pair:
    ocp, dt = thesis_regulator(plant, _STEPS), plant.model.dt or 0.0
    planned, gains = solve(ocp, Batch()), Riccati().prepare(ocp).K
    laws = (
        FeedbackLaw.following(planned),
        FeedbackLaw(law=lambda x, t: -gains[round(t / dt)] @ x),
    )
    batch, recursive = (
        closed_loop(law, Plant(ocp=ocp), planned.x0, _STEPS * dt, dt=dt).or_raise() for law in laws
    )
    apart = (np.abs(batch.x - recursive.x).max(), np.abs(batch.inputs - recursive.inputs).max())
    return _Pair(plant.name, batch, recursive, planned.cost, float(max(apart)))


def _columns(
    pair: _Pair, letter: str, of: Callable[[Rollout], np.ndarray]
) -> dict[str, np.ndarray]:
    columns = {"t [s]": pair.batch.t}
    for kind, loop in (("batch", pair.batch), ("recursive", pair.recursive)):
        for i, values in enumerate(of(loop).T):
            columns[f"{letter}_{i + 1}, {pair.name}, {kind} [-]"] = values
    return columns


def _sentence(number: str, what: str) -> str:
    first, second = _pairs()
    return (
        f"Fig. {number}: the {what} of the batch approach, fed forward, and of the recursive one, "
        f"fed back, lie on each other: states and inputs differ by at most {first.worst:.0e} on "
        f"the {first.name} (cost {first.cost:.4f}) and {second.worst:.0e} on the {second.name} "
        f"(cost {second.cost:.4f}). Chosen here: N = {_STEPS}; plants 2.50 and 2.53, weights 2.55; "
        f"the first {_DRAWN:g} s are drawn."
    )
