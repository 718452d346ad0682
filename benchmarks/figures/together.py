"""Fig. 3.14: instantaneous control, Schuetz' method and shooting on the same scenario."""

from functools import partial
from typing import NamedTuple

import casadi as ca
import numpy as np
from matplotlib.axes import Axes

from benchmarks.cases import arm_scenario
from benchmarks.figures.drawing import COLOURS, FINITE, REFERENCE, Drawing, label, sheet
from benchmarks.methods.tuned_kinematics import tuned_kinematics
from benchmarks.pictures.animation import animate
from benchmarks.pictures.arm_drawing import draw_obstacles, draw_postures, metres
from models import ArmScenario, link_distances
from ocp import Solution, evaluate, solve
from solvers import IndirectShooting, MultipleShooting, Schuetz, polish

# Along a horizontal line for 1.5 s, as in the thesis.
SCENARIO = "arm-001"
_COMBINE = "sum"
_STEPS = 150
_POSTURES = 7
_COLOURS = (FINITE, COLOURS[1], COLOURS[3], "black")


class _ArmMotion(NamedTuple):
    """The referee's view: instants (K,), angles (K, 3), closest link (K,), and the cost."""

    t: np.ndarray
    theta: np.ndarray
    distance: np.ndarray
    cost: float
    status: str


def together() -> Drawing:
    """Draw the postures of all side by side, and the distance of the closest link over time."""
    scenario = arm_scenario(SCENARIO)
    motions, from_zero = _motions(scenario)
    picture = sheet(17.0, 8.6)
    grid = picture.add_gridspec(2, len(motions), height_ratios=(1.0, 0.9))
    over_time, columns = picture.add_subplot(grid[1, :]), {}
    for k, (colour, (name, motion)) in enumerate(zip(_COLOURS, motions.items(), strict=True)):
        _draw_arm(picture.add_subplot(grid[0, k]), scenario, motion, name)
        style = "--" if colour == "black" else "-"
        over_time.plot(motion.t, motion.distance, style, color=colour, label=name)
        columns |= {
            f"t, {name} [s]": motion.t,
            f"distance, {name} [m]": motion.distance,
            **{f"theta_{i}, {name} [rad]": row for i, row in enumerate(motion.theta.T)},
        }
    for level, what in ((scenario.radius, "d_b"), (scenario.influence, "d_m")):
        over_time.axhline(level, **REFERENCE)
        over_time.text(0.0, level, f" {what}", va="bottom")
    label(over_time, "time [s]", "distance of the closest link from the centre [m]")
    over_time.legend(fontsize=8)
    best = motions["optimum"]
    film = partial(
        animate, scenario.arm, best.t, best.theta,
        obstacles=(scenario.disc,), influence=scenario.influence, title=scenario.name,
    )  # fmt: skip
    return Drawing(picture, columns, _sentence(motions, from_zero), film)


def _motions(scenario: ArmScenario) -> tuple[dict[str, _ArmMotion], _ArmMotion]:
    """Return what is drawn, and where shooting ends from costates zero."""
    ocp, tuned = scenario.ocp(_COMBINE), tuned_kinematics(scenario, _COMBINE)
    assert tuned is not None  # on this scenario candidates stay on the path
    shooting = IndirectShooting(steps=_STEPS)
    found = {
        "instantaneous, tuned": tuned.solution,
        "Schuetz, as in the thesis": solve(ocp, Schuetz()),
        "shooting": solve(ocp, shooting, guess=solve(ocp, Schuetz.sound())),
        "optimum": polish(solve(ocp, MultipleShooting(_STEPS))),
    }
    motions = {name: _seen(scenario, solution) for name, solution in found.items()}
    return motions, _seen(scenario, solve(ocp, shooting))


def _seen(scenario: ArmScenario, solution: Solution) -> _ArmMotion:
    verdict, theta = evaluate(solution), ca.SX.sym("theta", scenario.arm.n)
    truth, closest = verdict.truth, ca.mmin(link_distances(scenario.arm, theta, scenario.disc))
    distance = ca.Function("d", [theta], [closest]).map(len(truth.t))(truth.x.T)
    status = solution.status.name
    return _ArmMotion(truth.t, truth.x, np.array(distance).ravel(), verdict.cost, status)


def _draw_arm(axes: Axes, scenario: ArmScenario, motion: _ArmMotion, name: str) -> None:
    instants = np.linspace(0.0, scenario.horizon, _POSTURES)
    rows = np.stack([np.interp(instants, motion.t, row) for row in motion.theta.T], axis=1)
    draw_obstacles(axes, (scenario.disc,), scenario.influence)
    draw_postures(axes, scenario.arm.positions(rows))
    metres(axes)
    axes.set_title(f"{name}: {motion.cost:.3f}", fontsize=10)


def _sentence(motions: dict[str, _ArmMotion], from_zero: _ArmMotion) -> str:
    best = motions["optimum"].cost
    told = [
        f"{name} costs {motion.cost:.4f} ({100.0 * (motion.cost / best - 1.0):+.1f} %, "
        f"{motion.status})"
        for name, motion in motions.items()
        if name != "optimum"
    ]
    start = motions["optimum"].distance[0]
    least = min(motion.distance.min() for motion in motions.values())
    radius = arm_scenario(SCENARIO).radius
    return (
        f"Fig. 3.14: no link comes closer to the disc's centre "
        f"than {least:.3f} m, and the start already is at {start:.3f} m. {'; '.join(told)}, all by "
        f"the referee, above the certified optimum of {best:.4f}. Shooting begins with the costate "
        f"of the sound version of Schuetz' method; from psi(t0) = 0 it ends {from_zero.status} at "
        f"{from_zero.cost:.2f}, a link {from_zero.distance.min():.3f} m from the centre. Chosen "
        f"here: {SCENARIO}, d_b = {radius:g} m, the distance cost of all links, the gains "
        f"of instantaneous control by a search (tuned_kinematics), Schuetz with 75 Euler "
        f"steps from y = 0."
    )
