"""The figures of the thesis, each drawn from results computed for it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.figures import (
    basin,
    boundary_types,
    cart_pole,
    closed_arm,
    constrained,
    descent,
    descent_gap,
    dial,
    dilemma,
    dynamic_programming,
    extremals,
    free_and_forced,
    horizon_map,
    horizons,
    instantaneous,
    interval,
    newton_steps,
    over_horizon,
    over_links,
    predictive,
    regulation,
    together,
)
from benchmarks.figures.drawing import Drawing, write


@dataclass(frozen=True)
class Figure:
    """A figure of the thesis.

    Attributes:
        number: as the thesis has it, or a name where it has none.
        about: what it shows, in a few words.
        draw: computes and draws it.
    """

    number: str
    about: str
    draw: Callable[[], Drawing]

    @property
    def stem(self) -> str:
        """Name of its files, without extension."""
        return f"fig-{self.number}"


FIGURES = (
    Figure("2.2", "dynamic programming with one state", dynamic_programming.value_function),
    Figure("2.3", "states, batch and recursive", regulation.states),
    Figure("2.4", "inputs, batch and recursive", regulation.inputs),
    Figure("2.5", "finite-horizon control", horizons.finite),
    Figure("2.6", "model predictive control", horizons.receding_horizon),
    Figure("2.7", "free and forced response", free_and_forced.responses),
    Figure("2.8", "outputs under GPC", predictive.outputs),
    Figure("2.9", "cost of GPC over the horizon", predictive.costs),
    Figure("2.10", "constrained position", constrained.positions),
    Figure("2.11", "velocity under a constrained position", constrained.velocities),
    Figure("2.12", "approaching the constraint", constrained.approach),
    Figure("2.13", "a smaller interval", interval.smaller_steps),
    Figure("2.14", "horizon and interval", horizon_map.horizon_and_interval),
    Figure("3.3", "gains of the repulsive velocity", instantaneous.gains),
    Figure("3.4", "null-space motion past an obstacle", instantaneous.avoidance),
    Figure("3.6", "Newton's steps in single shooting", newton_steps.convergence),
    Figure("3.8", "the self-motion at t1", boundary_types.self_motion),
    Figure("3.9", "type 3 without obstacle", boundary_types.free_start),
    Figure("3.10", "types 3 and 4 with an obstacle", extremals.with_obstacle),
    Figure("3.11", "type 4 without obstacle", boundary_types.given_start),
    Figure("3.12", "convergence of Schuetz' method", descent.convergence),
    Figure("3.13", "its climb, with the tests off", descent.climb),
    Figure("3.13a", "what makes it climb", descent.causes),
    Figure("3.13b", "its gap over the step length", descent_gap.over_step),
    Figure("3.13c", "its gap over the start", descent_gap.over_start),
    Figure("3.14", "three kinds of control side by side", together.together),
    Figure("3.15", "cost of all methods over the horizon", over_horizon.costs),
    Figure("3.16", "the cost function dilemma", dilemma.costs),
    Figure("3.17", "receding horizons and instantaneous control", closed_arm.motions),
    Figure("3.18", "running cost over time", closed_arm.running_costs),
    Figure("3.19", "total cost over the horizon", dial.total_costs),
    Figure("3.20", "boundary condition of shooting", closed_arm.boundary_residual),
    Figure("3.21", "terminations of Schuetz' method", closed_arm.terminations),
    Figure("cart-pole", "a swing-up within force and track", cart_pole.swing_up),
    Figure("basin", "the basins of single shooting", basin.basins),
    Figure("links", "gap and effort over the number of links", over_links.links),
)


def chosen(numbers: Sequence[str]) -> tuple[Figure, ...]:
    """Return the figures of these numbers, all of them if there is none.

    Raises:
        KeyError: for the first number that is not that of a figure.
    """
    known = {figure.number: figure for figure in FIGURES}
    return tuple(known[number] for number in dict.fromkeys(numbers)) if numbers else FIGURES


def draw_all(figures: Sequence[Figure], out: Path) -> Iterator[tuple[Figure, Drawing]]:
    """Draw one after the other, write each to ``fig-<number>.png`` and ``.csv``, and yield it."""
    for figure in figures:
        drawing = figure.draw()
        write(drawing, figure.stem, out)
        yield figure, drawing
