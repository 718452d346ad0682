"""Fig. 3.16: diverging and finite distance costs, and a constraint instead of either."""

from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from benchmarks.cases import arm_scenario, soft_optimum
from benchmarks.figures.drawing import COLOURS, FINITE, REFERENCE, Drawing, label, sheet
from models import DistanceCost, link_distances
from models.textbook import BarrierCost, bounded_ocp, unbounded_ocp
from ocp import Solution, Status, evaluate, solve
from solvers import BetweenNodes, IndirectShooting, MultipleShooting, Schuetz, penalty_continuation

SCENARIO = "arm-011"
# A price of collision that is paid, as a share of the scenario's own.
_LOW = 1e-3
_BARRIER = 1e-3  # [m^2]


class _CollisionRuns(NamedTuple):
    broken: tuple[Status, Status]
    paid: Solution
    raised: Solution
    hard: Solution


def costs() -> Drawing:
    """Draw both costs over the distance, and what the arm does under each."""
    picture = sheet(11.0, 9.0)
    ((first, moves), (diverging, finite)) = picture.subplots(2, 2)
    columns = _draw_costs(diverging, finite)
    runs = _runs()
    first_guess = runs.paid.with_(u=np.zeros_like(runs.paid.u))
    _draw_arm(first, first_guess, "first controls y = 0: through the disc, where 1/(d - d_b) ends")
    for solution, colour in ((runs.paid, FINITE), (runs.raised, COLOURS[1]), (runs.hard, "k")):
        t, d = _distance(solution)
        name = {FINITE: "price too low", COLOURS[1]: "price raised", "k": "hard clearance"}[colour]
        moves.plot(t, d, color=colour, label=name)
        columns |= {f"t, {name} [s]": t, f"distance, {name} [m]": d}
    moves.axhline(arm_scenario(SCENARIO).radius, **REFERENCE)
    label(moves, "time [s]", "closest link to centre [m]", "finite cost, and the constraint")
    moves.legend(fontsize=8)
    return Drawing(picture, columns, _sentence(runs))


@cache
def _runs() -> _CollisionRuns:
    scenario = arm_scenario(SCENARIO)
    barrier, soft = unbounded_ocp(scenario, gain=_BARRIER), bounded_ocp(scenario)
    hard = scenario.ocp(weight=0.0, clearance=scenario.radius)
    broken = (
        solve(barrier, Schuetz.sound()).status,
        solve(barrier, IndirectShooting(steps=150)).status,
    )
    direct, start = MultipleShooting(75), soft_optimum(SCENARIO)
    program = direct.build(soft)
    paid = program.run(parameters={"weight": _LOW})
    raised = penalty_continuation(
        bounded_ocp(scenario, weight=_LOW), hard, direct, parameter="weight"
    )
    return _CollisionRuns(broken, paid, raised, solve(hard, BetweenNodes(direct), guess=start))


def _draw_arm(axes: Axes, solution: Solution, title: str) -> None:
    scenario = arm_scenario(SCENARIO)
    joints = scenario.arm.positions(evaluate(solution).truth.x)
    for k in np.linspace(0, len(joints) - 1, 7).astype(int):
        shade = 0.25 + 0.7 * k / len(joints)
        axes.plot(joints[k, :, 0], joints[k, :, 1], "o-", ms=3, color=COLOURS[0], alpha=shade)
    axes.add_patch(Circle(scenario.obstacle, scenario.radius, color=FINITE, alpha=0.6))
    label(axes, "x [m]", "y [m]", title)
    axes.set_aspect("equal", adjustable="datalim")


def _draw_costs(diverging: Axes, finite: Axes) -> dict[str, np.ndarray]:
    s = arm_scenario(SCENARIO)
    d, distance = np.linspace(0.0, 1.1 * s.influence, 401), ca.SX.sym("d")
    without = BarrierCost(_BARRIER, s.influence).at_distance(distance, s.radius)
    within = DistanceCost(s.gain, s.influence).at_distance(distance, s.radius)
    function = ca.Function("costs", [distance], [without, within]).map(len(d))
    unbounded, bounded = (np.array(v).ravel() for v in function(d[None, :]))
    shown = np.where(np.isfinite(unbounded), unbounded, np.nan)
    diverging.plot(d, shown, color=COLOURS[0])
    diverging.set_ylim(0.0, 20.0)
    finite.plot(d, bounded, color=COLOURS[0])
    for axes, title in ((diverging, "diverging: no value inside"), (finite, "finite: (3.48)")):
        axes.axvline(s.radius, **REFERENCE)
        label(axes, "distance of the link from the centre [m]", "p0", title)
    blank = np.where(np.isfinite(unbounded), unbounded, -1.0)
    return {"distance [m]": d, "diverging p0, -1 for inf [-]": blank, "finite p0 [-]": bounded}


def _distance(solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Distance of the closest link along the controls' true motion, (K,) each."""
    s, truth = arm_scenario(SCENARIO), evaluate(solution).truth
    theta = ca.SX.sym("theta", s.arm.n)
    closest = ca.Function("d", [theta], [ca.mmin(link_distances(s.arm, theta, s.disc))])
    return truth.t, np.array(closest.map(len(truth.t))(truth.x.T)).ravel()


def _sentence(runs: _CollisionRuns) -> str:
    schuetz, shooting = runs.broken
    radius = arm_scenario(SCENARIO).radius
    deep, clear, least = (_distance(s)[1].min() for s in (runs.paid, runs.raised, runs.hard))
    effort, least_effort = (
        evaluate(s.with_(problem=runs.hard.problem, parameters={})).cost
        for s in (runs.raised, runs.hard)
    )
    price = float(runs.raised.parameters["weight"][0])
    return (
        f"Fig. 3.16: with a cost that diverges at the disc the "
        f"first controls have no cost, Schuetz ends with {schuetz.name} and shooting with "
        f"{shooting.name}; with a finite one at {_LOW:g} of the price the arm goes through "
        f"(closest link {deep:.3f} m from the centre). Doubling the price to {price:.3g} clears it "
        f"({clear:.3f} m, effort {effort:.2f}); the constraint d >= d_b does so at {least:.3f} m "
        f"and effort {least_effort:.2f}. Chosen here: {SCENARIO}, d_b = {radius:g} m, prices "
        f"doubled from {_LOW:g} on, 75 intervals."
    )
