"""Fig. 3.3 and 3.4: the gains of the repulsive velocity, and what it does to an arm."""

from functools import partial

import casadi as ca
import numpy as np
from matplotlib.axes import Axes

from benchmarks.cases import arm_scenario
from benchmarks.figures.drawing import COLOURS, FINITE, REFERENCE, Drawing, label, sheet
from benchmarks.methods.tuned_kinematics import instantaneous
from benchmarks.pictures.animation import animate
from benchmarks.pictures.arm_drawing import draw_obstacles, draw_postures, metres
from models import ArmScenario, link_distances
from ocp import evaluate
from solvers import KinematicRun, PrioritisedKinematics, Repulsion

_SCENARIO = "arm-001"
_INFLUENCE = 0.6  # [m]
_REPULSION = Repulsion(v0=0.2, d_m=_INFLUENCE, d_i=0.9)
_SAMPLING = 1e-3  # [s]
_FEEDBACK = 100.0  # [1/s]
_POSTURES = 8
_HIGHEST = 10.0  # of alpha_v, drawn


def gains() -> Drawing:
    """Draw alpha_v and alpha_h over the distance."""
    d = np.linspace(0.02, 1.2, 592)
    symbol = ca.SX.sym("d")
    both = ca.vertcat(_REPULSION.velocity_gain(symbol), _REPULSION.homogeneous_gain(symbol))
    velocity, homogeneous = np.array(ca.Function("gains", [symbol], [both]).map(len(d))(d[None, :]))
    picture = sheet(10.0, 4.0)
    left, right = picture.subplots(1, 2)
    left.plot(d, velocity, color=COLOURS[1])
    left.set_ylim(-0.3, _HIGHEST)
    right.plot(d, homogeneous, color=COLOURS[1])
    for axes, name in ((left, "obstacle avoidance gain α_v"), (right, "homogeneous gain α_h")):
        for at, what in ((_REPULSION.d_m, "d_m"), (_REPULSION.d_i, "d_i")):
            axes.axvline(at, **REFERENCE)
            axes.text(at, axes.get_ylim()[1], f" {what}", va="top")
        label(axes, "distance d [m]", name)
    return Drawing(
        picture,
        {"d [m]": d, "alpha_v [-]": velocity, "alpha_h [-]": homogeneous},
        f"Fig. 3.3: the repulsive speed α_v v0 rises from 0 at d_m = {_REPULSION.d_m:g} m like "
        f"(d_m/d)^2 - 1 and is {velocity[np.searchsorted(d, 0.3)]:.1f} v0 at half of it; the "
        f"homogeneous term fades in by a half cosine between d_i = {_REPULSION.d_i:g} m and d_m. "
        f"Chosen here: both formulas, which the thesis only draws; α_v stops at "
        f"{_REPULSION.ceiling:g}; the drawing ends at {_HIGHEST:g}.",
    )


def avoidance() -> Drawing:
    """Draw the arm with the path as its only task, and with an obstacle to avoid besides."""
    scenario = arm_scenario(_SCENARIO)
    both = instantaneous(scenario, _REPULSION, feedback=_FEEDBACK)
    runs = {
        "path only": _run(scenario, PrioritisedKinematics(both.tasks[:1])),
        "path, then obstacle": _run(scenario, both),
    }
    picture, columns = sheet(14.0, 4.8), {}
    *arms, over_time = picture.subplots(1, 3)
    for axes, colour, (name, run) in zip(arms, (FINITE, COLOURS[1]), runs.items(), strict=True):
        _draw_arm(axes, scenario, run, name)
        distance = _distance(scenario, run)
        over_time.plot(run.t, distance, color=colour, label=name)
        columns |= {
            "t [s]": run.t,
            f"distance, {name} [m]": distance,
            f"path error, {name} [m]": run.errors["path"],
            **{f"theta_{i}, {name} [rad]": row for i, row in enumerate(run.q.T)},
        }
    for level, what in ((scenario.radius, "d_b"), (_REPULSION.d_m, "d_m"), (_REPULSION.d_i, "d_i")):
        over_time.axhline(level, **REFERENCE)
        over_time.text(0.0, level, f" {what}", va="bottom")
    label(over_time, "time [s]", "distance of the closest link from the centre [m]")
    over_time.legend(fontsize=8)
    moved = runs["path, then obstacle"]
    film = partial(
        animate, scenario.arm, moved.t, moved.q,
        obstacles=(scenario.disc,), influence=_INFLUENCE, title=scenario.name,
    )  # fmt: skip
    return Drawing(picture, columns, _sentence(scenario, runs), film)


def _run(scenario: ArmScenario, controller: PrioritisedKinematics) -> KinematicRun:
    program = controller.build()
    return program.run(scenario.theta0, duration=scenario.horizon, dt=_SAMPLING)


def _draw_arm(axes: Axes, scenario: ArmScenario, run: KinematicRun, name: str) -> None:
    chosen = np.linspace(0, len(run.q) - 1, _POSTURES).astype(int)
    draw_obstacles(axes, (scenario.disc,), _INFLUENCE)
    draw_postures(axes, scenario.arm.positions(run.q[chosen]))
    metres(axes)
    axes.set_title(name, fontsize=10)


def _distance(scenario: ArmScenario, run: KinematicRun) -> np.ndarray:
    theta = ca.SX.sym("theta", scenario.arm.n)
    closest = ca.mmin(link_distances(scenario.arm, theta, scenario.disc))
    return np.array(ca.Function("d", [theta], [closest]).map(len(run.q))(run.q.T)).ravel()


def _sentence(scenario: ArmScenario, runs: dict[str, KinematicRun]) -> str:
    ocp = scenario.ocp("closest", form="velocity")
    verdicts = [evaluate(run.as_solution(ocp)) for run in runs.values()]
    least = [_distance(scenario, run).min() for run in runs.values()]
    return (
        f"Fig. 3.4: the null-space motion keeps the closest link {least[1]:.2f} m from the "
        f"obstacle's centre instead of {least[0]:.2f} m (d_b = {scenario.radius:g} m), costs "
        f"{verdicts[1].cost:.2f} instead of {verdicts[0].cost:.2f}, and the end effector stays on "
        f"its path to {max(v.task_drift for v in verdicts):.0e} m in both cases. Chosen here: "
        f"{scenario.name}, the cost of the closest link, v0 = {_REPULSION.v0:g} m/s, "
        f"d_m = {_REPULSION.d_m:g} m, d_i = {_REPULSION.d_i:g} m, K = {_FEEDBACK:g} / s, "
        f"{1e3 * _SAMPLING:g} ms."
    )
