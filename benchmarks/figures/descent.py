"""Fig. 3.12 and 3.13: how Schuetz' method converges, how it climbs, and what makes it climb."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from benchmarks.cases import arm_scenario
from benchmarks.figures.drawing import COLOURS, FINITE, Drawing, label, sheet
from ocp import OCP, Solution, solve
from solvers import Armijo, FixedStep, Schuetz

_NAME = "arm-001"
_STEPS = (0.003, 0.01, 0.03)
# With the larger step the cost climbs before the bottom is reached, with the smaller one after
# the gradient has become rounding.
_EARLY, _LATE = 0.1, 0.05
# The ten scenarios on which the climb is counted, and the step there.
_COUNTED, _COUNTED_STEP = tuple(f"arm-{i:03d}" for i in range(1, 11)), 0.02
# A climb of less than this above the lowest cost is Euler's own, not a runaway.
_RUNAWAY = 1e-3
_CHOSEN = (
    "Chosen here: {}, the closest link's distance cost, raw as in the thesis, "
    "75 Euler steps of 0.02 s, start at y = 0."
)


def untested(step: float, *, limit: int = 400) -> Schuetz:
    """Return Algorithm 2 without its termination tests, but for the number of iterations."""
    return Schuetz(
        step=FixedStep(step),
        decrease=0.0,
        stop_on_rise=False,
        stationarity=0.0,
        max_iterations=limit,
    )


def convergence() -> Drawing:
    """Draw the cost of Algorithm 2 over its iterations."""
    ocp = _problem(_NAME)
    runs = {step: solve(ocp, Schuetz(step=FixedStep(step))) for step in _STEPS}
    bottom = min(_costs(solve(ocp, untested(step, limit=60))).min() for step in _STEPS)
    picture, columns = sheet(11.0, 4.6), {}
    whole, above = picture.subplots(1, 2)
    for (step, run), colour in zip(runs.items(), COLOURS, strict=False):
        costs = _costs(run)
        whole.plot(costs, ".-", color=colour, label=f"alpha = {step}")
        above.semilogy(costs / bottom - 1.0, ".-", color=colour, label=f"alpha = {step}")
        columns[f"iteration, alpha = {step} [-]"] = np.arange(len(costs))
        columns[f"L, alpha = {step} [rad^2/s]"] = costs
    label(whole, "iteration", "cost L [rad²/s]", "Algorithm 2 with its termination tests")
    label(above, "iteration", "L above the lowest, relative", "the same, above the bottom")
    whole.legend(fontsize=8)
    count = ", ".join(str(run.iterations) for run in runs.values())
    left = ", ".join(f"{100 * (_costs(r)[-1] / bottom - 1):.2f}" for r in runs.values())
    sentence = (
        f"Fig. 3.12: the cost falls smoothly and the relative decrease ends the descent, after "
        f"{count} iterations for alpha = {', '.join(map(str, _STEPS))}; that is {left} % above the "
        f"bottom. "
        f"{_CHOSEN.format(_NAME)}"
    )
    return Drawing(picture, columns, sentence)


def climb() -> Drawing:
    """Draw the cost with the termination tests off."""
    ocp = _problem(_NAME)
    free = {step: solve(ocp, untested(step)) for step in (_EARLY, _LATE)}
    picture, columns = sheet(11.0, 4.6), {}
    cost, gradient = picture.subplots(1, 2)
    for (step, run), colour in zip(free.items(), (FINITE, COLOURS[0]), strict=True):
        costs, gradients = _costs(run), np.asarray(run.history["residual"])
        tested = solve(ocp, Schuetz(step=FixedStep(step)))
        cost.semilogy(costs, ".-", ms=4, color=colour, label=f"alpha = {step}, tests off")
        cost.plot(tested.iterations, _costs(tested)[-1], "o", mfc="none", ms=10, color=colour,
                  label="where the tests stop it")  # fmt: skip
        gradient.semilogy(gradients, ".-", ms=4, color=colour)
        columns |= {
            f"iteration, alpha = {step} [-]": np.arange(len(costs)),
            f"L, alpha = {step} [rad^2/s]": costs,
            f"largest dH/dy, alpha = {step} [rad/s]": gradients,
        }
    cost.set_ylim(3.0, 1e3)
    gradient.set_ylim(1e-15, 1e5)
    label(cost, "iteration", "cost L [rad²/s]", "the cost falls, then climbs")
    label(gradient, "iteration", "largest |∂H/∂y| [rad/s]", "its gradient")
    cost.legend(fontsize=8)
    early, late = (_costs(run) for run in free.values())
    least = np.asarray(free[_LATE].history["residual"]).min()
    sentence = (
        f"Fig. 3.13: with the tests off the cost climbs, faster and faster, to overflow. With "
        f"alpha = {_EARLY} it does so from iteration {early.argmin()} on, before the bottom is "
        f"reached. With alpha = {_LATE} it first converges until its gradient is rounding "
        f"({least:.0e}); beta, a ratio of roundings, then exceeds one and the same climb begins "
        f"after some {_doubled(late) - 5} iterations. {_CHOSEN.format(_NAME)}"
    )
    return Drawing(picture, columns, sentence)


def causes() -> Drawing:
    """Draw the same start and step without what makes it climb, and count over scenarios."""
    ocp, free = _problem(_NAME), untested(_EARLY, limit=40)
    steepest = replace(free, direction="steepest")
    runs = {
        "Fletcher-Reeves, fixed step": solve(ocp, free),
        "steepest descent, the same step": solve(ocp, steepest),
        "Fletcher-Reeves, line search": solve(ocp, replace(free, step=Armijo())),
        "line search and restarts": solve(
            ocp, replace(free, step=Armijo(), direction="polak-ribiere")
        ),
    }
    picture, columns = sheet(12.0, 4.8), {}
    left, right = picture.subplots(1, 2, width_ratios=(1.0, 1.0))
    for (name, run), colour in zip(runs.items(), (FINITE, *COLOURS), strict=False):
        costs = _costs(run)
        left.semilogy(costs, ".-", ms=4, color=colour, label=name)
        columns[f"L, {name} [rad^2/s]"] = costs
    label(left, "iteration", "cost L [rad²/s]", f"{_NAME}, tests off, alpha = {_EARLY}")
    left.set_ylim(3.0, 1e4)
    left.legend(fontsize=8)
    conjugate, plain = (_climbs(direction) for direction in ("fletcher-reeves", "steepest"))
    _bars(right, conjugate, plain)
    columns |= {
        "scenario [-]": np.arange(1, len(_COUNTED) + 1),
        "highest over lowest cost after it, Fletcher-Reeves [-]": conjugate,
        "highest over lowest cost after it, steepest [-]": plain,
    }
    over, stay = ((c - 1.0 > _RUNAWAY).sum() for c in (conjugate, plain))
    sentence = (
        f"Fig. 3.13a: the climb needs conjugate directions and a fixed step together. Steepest "
        f"descent with the same step stays at the bottom, and a line search takes the climb away. "
        f"On ten scenarios with alpha = {_COUNTED_STEP} and 400 iterations the cost climbs by more "
        f"than {100 * _RUNAWAY:g} % above its lowest on {over} with Fletcher-Reeves, on {stay} "
        f"with steepest descent (whose step is too large there from the start). "
        f"{_CHOSEN.format(f'{_COUNTED[0]} to {_COUNTED[-1]}')}"
    )
    return Drawing(picture, columns, sentence)


def _problem(name: str) -> OCP:
    return arm_scenario(name).ocp("closest", cost="raw")


def _costs(run: Solution) -> np.ndarray:
    return np.asarray(run.history["cost"])


def _doubled(costs: np.ndarray) -> int:
    """The first iteration after the lowest cost that costs twice as much."""
    lowest = int(costs.argmin())
    above = np.flatnonzero(costs[lowest:] > 2.0 * costs[lowest])
    return lowest + int(above[0]) if len(above) else len(costs)


def _climbs(direction: str) -> np.ndarray:
    """The highest cost after the lowest one, over the lowest, for each counted scenario."""
    ratios = []
    for name in _COUNTED:
        free = untested(_COUNTED_STEP)
        plain = replace(free, direction="steepest")
        costs = _costs(solve(_problem(name), plain if direction == "steepest" else free))
        ratios.append(costs[costs.argmin() :].max() / costs.min())
    return np.array(ratios)


def _bars(axes: Axes, conjugate: np.ndarray, plain: np.ndarray) -> None:
    place = np.arange(len(_COUNTED))
    floor = 1e-9
    for shift, ratios, name, colour in (
        (-0.2, conjugate, "Fletcher-Reeves", FINITE),
        (0.2, plain, "steepest descent", COLOURS[0]),
    ):
        axes.bar(place + shift, np.maximum(ratios - 1.0, floor), 0.38, color=colour, label=name)
    axes.set_yscale("log")
    axes.set_ylim(floor, 1e12)
    axes.axhline(_RUNAWAY, color="black", lw=0.8, ls="--")
    axes.set_xticks(place, [name[-3:] for name in _COUNTED])
    label(axes, "scenario", "climb above the lowest cost, relative", f"alpha = {_COUNTED_STEP}")
    axes.legend(fontsize=8)
