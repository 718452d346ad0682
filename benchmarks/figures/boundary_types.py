"""Figs. 3.8, 3.9 and 3.11: the redundant end configurations, integrated back without obstacle."""

from functools import cache

import numpy as np
from matplotlib.axes import Axes

from benchmarks.cases import arm_scenario
from benchmarks.figures.drawing import COLOURS, Drawing, label, sheet
from benchmarks.figures.scanned import columns, rows, transversality
from models import redundancy_ocp
from ocp import OCP, solve
from solvers import Enumeration, MultipleShooting, ReverseShooting, enumerate_extremals
from solvers.internal import InvariantManifold, SelfMotion, seeds_around, self_motions

_SCENARIO = "arm-001"
_POSTURES = 15
_CHOSEN = f"Chosen here: arm and line of {_SCENARIO}, its disc left out"


def self_motion() -> Drawing:
    """Draw the postures on both halves of the self-motion at t1, and the curve itself."""
    ocp = _bare(free_start=True)
    (curve,) = _curves(ocp)
    picture = sheet(13.0, 4.9)
    axes = picture.subplots(1, 3)
    for place, side, word in ((axes[0], -1.0, "down"), (axes[1], 1.0, "up")):
        _postures(place, curve, side, f"last elbow {word}")
    theta = np.degrees(curve.points)
    axes[2].plot(theta[:, 1], theta[:, 2], color=COLOURS[0])
    stretched = _extremes(curve)
    axes[2].plot(*np.degrees(stretched[:, 1:]).T, "o", color="tab:red", label="θ_3 = 0")
    axes[2].legend()
    label(axes[2], "θ_2 [deg]", "θ_3 [deg]", "the closed curve, traced by continuation")
    sentence = (
        "Fig. 3.8: base and end effector hold their places while the redundant degree of freedom "
        f"is explored. Both halves belong to one closed curve of {curve.length:.2f} rad: they are "
        "mirror images of each other, and meet in the two extremes (red) where the outer links "
        f"are stretched; {len(curve.points) - 1} steps of continuation went round. {_CHOSEN}."
    )
    data = {"arclength [rad]": curve.arc}
    data |= {f"θ_{i + 1} [rad]": column for i, column in enumerate(curve.points.T)}
    return Drawing(picture, data, sentence)


def free_start() -> Drawing:
    """Draw cost and transversality of type 3 over the end configuration."""
    found = _found(free=True)
    (scan,) = found.scans
    norms = transversality(found)
    solution = solve(_bare(free_start=True), ReverseShooting(boundary=3)).or_raise()
    direct = solve(solution.problem, MultipleShooting(300)).or_raise()
    picture = sheet(10.0, 8.4)
    axes = picture.subplots(3, 1, sharex=True)
    rows(axes, scan, norms, "‖N ψ(t_0)‖ [1/s]", found)
    best = found.solutions[0]
    sentence = (
        f"Fig. 3.9: without obstacle, over all end configurations, ‖N ψ(t_0)‖ has "
        f"{len(found.solutions)} zeros: in turn {len(found.minima)} minima and as many maxima of "
        f"the cost curve. The lowest minimum, {best.cost:.9f}, is the optimum; ReverseShooting of "
        f"type 3 takes {solution.iterations} Newton steps to {solution.cost:.9f}, direct multiple "
        f"shooting with a free start says {direct.cost:.9f}. The two halves of Fig. 3.8 do not "
        f"cost the same: the line misses the base. {_CHOSEN}."
    )
    return Drawing(picture, columns(scan, {"‖N ψ(t_0)‖ [1/s]": norms}), sentence)


def given_start() -> Drawing:
    """Draw cost and distance from the given start of type 4 over the end configuration."""
    found = _found(free=False)
    (scan,) = found.scans
    ocp, best = _bare(free_start=False), found.costs[0]
    away = np.linalg.norm(
        scan.curve.manifold.periods.wrapped(scan.starts - np.asarray(ocp.x0)), axis=1
    )
    solution = solve(ocp, ReverseShooting(boundary=4)).or_raise()
    direct = solve(ocp, MultipleShooting(300)).or_raise()
    picture = sheet(10.0, 8.4)
    axes = picture.subplots(3, 1, sharex=True)
    rows(axes, scan, away, "‖θ_int − θ_0‖ [rad]", found)
    sentence = (
        f"Fig. 3.11: the start is met by {_number(found)} end configuration"
        f"{'s' if len(found.solutions) > 1 else ''}, at cost {best:.6f}; the "
        f"cost curve says nothing there, its minima ({scan.costs.min():.6f}) belong to other "
        f"starts. ReverseShooting of type 4 takes {solution.iterations} Newton steps to "
        f"{solution.cost:.9f}, direct multiple shooting says {direct.cost:.9f}. {_CHOSEN}."
    )
    return Drawing(picture, columns(scan, {"‖θ_int − θ_0‖ [rad]": away}), sentence)


def _bare(*, free_start: bool) -> OCP:
    scenario = arm_scenario(_SCENARIO)
    return redundancy_ocp(
        scenario.arm,
        scenario.path,
        theta0=scenario.theta0,
        horizon=scenario.horizon,
        free_start=free_start,
        name="without obstacle",
    )


@cache
def _found(*, free: bool) -> Enumeration:
    return enumerate_extremals(_bare(free_start=free), spacing=0.1)


def _number(found: Enumeration) -> str:
    words = ("no", "one", "two", "three", "four", "five")
    return words[len(found.solutions)] if len(found.solutions) < len(words) else "several"


def _curves(ocp: OCP) -> tuple[SelfMotion, ...]:
    end = InvariantManifold.of(ocp).at(ocp.duration, ocp.parameter_values().at(1.0)[0])
    return self_motions(end, seeds_around(end, np.asarray(ocp.x0)))


def _side(theta: np.ndarray) -> np.ndarray:
    """Whether the last joint is bent up or down: the sign of its wrapped angle."""
    return np.sign(np.sin(theta[:, 2]))


def _extremes(curve: SelfMotion) -> np.ndarray:
    """Postures in which the outer links are stretched."""
    angle = np.angle(np.exp(1j * curve.points[:, 2]))
    turns = (angle[:-1] * angle[1:] <= 0.0) & (np.abs(angle[:-1]) < 1.0)
    return curve.points[:-1][turns]


def _postures(axes: Axes, curve: SelfMotion, side: float, title: str) -> None:
    arm = arm_scenario(_SCENARIO).arm
    half = curve.points[_side(curve.points) == side]
    chosen = half[np.linspace(0, len(half) - 1, _POSTURES).round().astype(int)]
    for posture in arm.positions(chosen):
        axes.plot(*posture.T, "-o", color=COLOURS[1], alpha=0.45, lw=1.5, ms=3)
    for posture in arm.positions(_extremes(curve)):
        axes.plot(*posture.T, "-o", color="tab:red", lw=2, ms=4)
    axes.plot(0.0, 0.0, "s", color="black", ms=8)
    axes.set_aspect("equal", adjustable="datalim")
    label(axes, "x [m]", "y [m]", title)
