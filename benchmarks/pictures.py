"""The picture of the main job: the arm past the obstacle, and the cost over iterations."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from benchmarks.cases import arm_scenario
from models import ArmScenario
from ocp import OCP, Solution, evaluate, solve
from solvers import FixedStep, MultipleShooting, Schuetz, polish

_POSTURES = 9


def bench_picture(case: str, out: Path) -> Path:
    """Draw one scenario solved by three methods and return the file.

    Args:
        case: name of an arm case, as ``arm-001-sum``.
        out: folder.
    """
    name, combine = case.rsplit("-", 1)
    scenario = arm_scenario(name)
    ocp = scenario.ocp("sum" if combine == "sum" else "closest")
    solutions = _solutions(ocp)
    figure = Figure(figsize=(13.0, 7.6), layout="constrained")
    grid = figure.add_gridspec(2, len(solutions), height_ratios=[1.35, 1.0])
    for i, (method, solution) in enumerate(solutions.items()):
        _motion(figure.add_subplot(grid[0, i]), scenario, method, solution)
    _convergence(figure.add_subplot(grid[1, :]), solutions)
    figure.suptitle(f"{name}: a redundant arm passes an obstacle, solved three ways")
    out.mkdir(parents=True, exist_ok=True)
    file = out / f"{case}.png"
    figure.savefig(file, dpi=130)
    return file


def _solutions(ocp: OCP) -> dict[str, Solution]:
    direct = solve(ocp, MultipleShooting())
    return {
        "direct multiple shooting": direct,
        "Schuetz, line search": solve(ocp, Schuetz.sound()),
        "indirect multiple shooting": polish(direct),
        "Schuetz, Algorithm 2": solve(ocp, Schuetz(step=FixedStep(0.01))),
    }


def _motion(axes: Axes, scenario: ArmScenario, method: str, solution: Solution) -> None:
    times = np.linspace(solution.t[0], solution.t[-1], _POSTURES)
    postures = scenario.arm.positions(solution.state(times))
    hand = scenario.arm.positions(solution.state(np.linspace(times[0], times[-1], 100)))[:, -1]
    center = scenario.obstacle
    axes.add_patch(Circle(center, scenario.influence, color="tab:red", alpha=0.10, lw=0))
    axes.add_patch(Circle(center, scenario.radius, color="tab:red", alpha=0.55, lw=0))
    for i, posture in enumerate(postures):
        shade = 0.15 + 0.85 * i / (_POSTURES - 1)
        axes.plot(*posture.T, "-o", color="tab:blue", alpha=shade, lw=2, ms=3)
    axes.plot(*hand.T, color="black", lw=1.5, label="end effector")
    axes.plot(*postures[0, 0], "s", color="black", ms=7)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(f"{method}\ncost {evaluate(solution).cost:.4f}", fontsize=10)


def _convergence(axes: Axes, solutions: Mapping[str, Solution]) -> None:
    for method, solution in solutions.items():
        cost = solution.history.get("cost")
        if cost is not None and len(cost):
            axes.semilogy(cost, "-o", ms=3, label=method)
        else:
            axes.axhline(solution.cost, color="black", ls="--", lw=1, label=f"{method} (its end)")
    axes.set_xlabel("iteration")
    axes.set_ylabel("cost, as the method sees it")
    axes.set_title("cost over iterations (direct iterates are infeasible on the way)", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend()
