"""The picture of the main job: the arm past the obstacle, and the cost over iterations."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.cases import arm_scenario
from benchmarks.pictures.arm_drawing import draw_obstacles, draw_postures, metres
from models import ArmScenario
from ocp import Solution, evaluate, solve
from ocp.internal import replacing
from solvers import FixedStep, IndirectShooting, MultipleShooting, Schuetz, polish

_POSTURES = 9


def bench_picture(case: str, out: Path) -> Path:
    """Draw one scenario solved by every kind of method and return the file.

    Args:
        case: name of an arm case, as ``arm-001-sum``.
        out: folder.
    """
    name, combine = case.rsplit("-", 1)
    scenario = arm_scenario(name)
    ocp = scenario.ocp("sum" if combine == "sum" else "closest")
    direct, sound = solve(ocp, MultipleShooting()), solve(ocp, Schuetz.sound())
    extremal = polish(direct)
    motions = {
        "direct multiple shooting": direct,
        "Schuetz, line search": sound,
        "indirect multiple shooting": extremal,
        "single shooting from psi = 0": solve(ocp, IndirectShooting()),
    }
    descents = {
        "direct multiple shooting (infeasible on the way)": direct,
        "Schuetz, line search": sound,
        "Schuetz, Algorithm 2 of the thesis": solve(ocp, Schuetz(step=FixedStep(0.01))),
    }
    figure = Figure(figsize=(14.0, 6.8), layout="constrained")
    grid = figure.add_gridspec(2, len(motions), height_ratios=[1.0, 1.0])
    for i, (method, solution) in enumerate(motions.items()):
        _motion(figure.add_subplot(grid[0, i]), scenario, method, solution)
    _convergence(figure.add_subplot(grid[1, :]), descents, evaluate(extremal).cost)
    figure.suptitle(f"{name}: a redundant arm follows a line past an obstacle")
    out.mkdir(parents=True, exist_ok=True)
    file = out / f"{case}.png"
    with replacing(file) as draft:
        figure.savefig(draft, dpi=130)
    return file


def _motion(axes: Axes, scenario: ArmScenario, method: str, solution: Solution) -> None:
    times = np.linspace(solution.t[0], solution.t[-1], _POSTURES)
    postures = scenario.arm.positions(solution.state(times))
    draw_obstacles(axes, (scenario.disc,), scenario.influence)
    draw_postures(axes, postures)
    metres(axes)
    cost, word = evaluate(solution).cost, solution.status.name.replace("_", " ").lower()
    axes.set_title(f"{method}\n{word}, cost {cost:.4f}", fontsize=10)


def _convergence(axes: Axes, descents: Mapping[str, Solution], optimum: float) -> None:
    for method, solution in descents.items():
        above = np.asarray(solution.history["cost"]) / optimum - 1.0
        above[above <= 0.0] = np.nan  # an infeasible iterate may cost less than the optimum
        axes.semilogy(above, "-o", ms=3, label=method)
    axes.set_xlabel("iteration")
    axes.set_ylabel("cost above the optimum, relative")
    axes.set_title(
        "as each method sees its cost: what is left in the end is the discretisation "
        "(75 held controls; Algorithm 2 with Euler steps)",
        fontsize=10,
    )
    axes.grid(alpha=0.3)
    axes.legend()
