"""Fig. 3.17, 3.18, 3.20 and 3.21: the arm in closed loop, and how its solvers ended."""

from functools import cache

import numpy as np

from benchmarks.cases import arm_scenario
from benchmarks.figures.drawing import COLOURS, FINITE, REFERENCE, Drawing, held, label, sheet
from benchmarks.mpc.arm_loop import CORRECTION, DT, INSTANTANEOUS, loop
from benchmarks.pictures.arm_drawing import draw_obstacles, draw_postures, metres
from ocp import Rollout, Status, solve
from solvers import MultipleShooting

SCENARIO = "arm-001"
HORIZON = 0.35  # [s]
BOUND = 1e-4  # of psi(t_f), as the thesis asks
_SHORT, _LONG = 0.1, 0.8
_LATE = 0.5  # [s]
_POSTURES, _PREVIEWS = 7, 8
_YELLOW = "#e8c10a"
_ENDS = {
    Status.SOLVED: "gradient below its bound",
    Status.STATIONARY: "gradient below its bound",
    Status.SMALL_DECREASE: "cost decrease below ε",
    Status.COST_ROSE: "cost rose",
    Status.ITERATION_LIMIT: "iterations used up",
}
_CHOSEN = (
    f"Chosen here: {SCENARIO}, the sum of the links' distance costs, interval {1e3 * DT:g} ms, "
    f"K = {CORRECTION:g} / s"
)


@cache
def run(kind: str, horizon: float = HORIZON) -> Rollout:
    """Return a loop over the whole task, or raise if it ended early."""
    return loop(arm_scenario(SCENARIO), kind, horizon).or_raise()


def motions() -> Drawing:
    """Draw the postures of instantaneous control and of both receding horizons."""
    scenario = arm_scenario(SCENARIO)
    runs = {
        INSTANTANEOUS: run(INSTANTANEOUS),
        "MPC, shooting": run("shooting"),
        "MPC, Schuetz": run("schuetz"),
    }
    picture, columns = sheet(14.0, 5.0), {}
    for axes, (name, rollout) in zip(picture.subplots(1, 3), runs.items(), strict=True):
        draw_obstacles(axes, (scenario.disc,), scenario.influence)
        chosen = np.linspace(0, len(rollout.x) - 1, _POSTURES).astype(int)
        draw_postures(axes, scenario.arm.positions(rollout.x[chosen]))
        if "Schuetz" in name:
            _previews(axes, scenario, rollout)
        metres(axes)
        axes.set_title(f"{name}: cost {rollout.cost:.3f}", fontsize=10)
        columns["t [s]"] = rollout.t
        columns |= {f"theta_{i}, {name} [rad]": row for i, row in enumerate(rollout.x.T, start=1)}
    ours, theirs = runs["MPC, shooting"], runs["MPC, Schuetz"]
    apart = np.abs(ours.x - theirs.x).max()
    return Drawing(
        picture,
        columns,
        f"Fig. 3.17: with a horizon of {HORIZON:g} s the loops around shooting and around Schuetz' "
        f"method stay within {apart:.3f} rad and cost {ours.cost:.3f} and {theirs.cost:.3f} "
        f"({100 * abs(theirs.cost / ours.cost - 1):.1f} % apart); instantaneous control, its gains "
        f"tuned, costs {runs[INSTANTANEOUS].cost:.3f}. Yellow: some of Schuetz' plans, the "
        f"elbow's and the wrist's path. {_CHOSEN}.",
    )


def _previews(axes, scenario, rollout: Rollout) -> None:
    """Draw where some plans lead the joints."""
    for k in np.linspace(0, len(rollout.decisions) - 1, _PREVIEWS).astype(int):
        plan = rollout.decisions[k].plan
        if plan is not None:
            joints = scenario.arm.positions(plan.x)
            for i in range(1, joints.shape[1] - 1):
                axes.plot(*joints[:, i].T, color=_YELLOW, lw=2.0, zorder=5)


def running_costs() -> Drawing:
    """Draw the running cost over time, up to the finite horizon's."""
    names = {f"MPC, {h:g} s": run("shooting", h) for h in (_SHORT, HORIZON, _LONG)}
    runs = {INSTANTANEOUS: run(INSTANTANEOUS), **names}
    picture, columns = sheet(10.0, 5.0), {}
    axes = picture.subplots()
    colours = ("tab:red", *COLOURS)
    for colour, (name, rollout) in zip(colours, runs.items(), strict=False):
        rates = rollout.costs / np.diff(rollout.t)
        held(axes, rollout.t, rates, color=colour, label=f"{name}: {rollout.cost:.3f} in all")
        columns |= {"t [s]": rollout.t[:-1], f"{name} [rad²/s²]": rates}
    ocp = arm_scenario(SCENARIO).ocp("sum")
    best = solve(ocp, MultipleShooting(150)).or_raise()
    rates = np.array(ocp.functions.running_cost.map(150)(best.x[:-1].T, best.u.T, best.t[None, :-1],
                                                         np.zeros((0, 150)))).ravel()  # fmt: skip
    axes.plot(best.t[:-1], rates, color=FINITE, lw=2, label=f"finite horizon: {best.cost:.3f}")
    columns |= {"t, finite horizon [s]": best.t[:-1], "finite horizon [rad²/s²]": rates}
    axes.set_yscale("log")
    label(axes, "time [s]", "running cost [rad²/s²]")
    axes.legend(fontsize=8)
    first = {name: rollout.costs[0] / DT for name, rollout in runs.items()}
    late = round(_LATE / DT)
    then = {name: rollout.costs[late] / DT for name, rollout in runs.items()}
    short = f"MPC, {_SHORT:g} s"
    return Drawing(
        picture,
        columns,
        f"Fig. 3.18: the longer the horizon, the closer the running cost to the finite horizon's, "
        f"which begins at {rates[0]:.0f} and is {np.interp(_LATE, best.t[:-1], rates):.1f} after "
        f"{_LATE:g} s. A horizon of {_SHORT:g} s saves at first ({first[short]:.0f}) and pays "
        f"later ({then[short]:.1f}); instantaneous control jumps aside at once "
        f"({first[INSTANTANEOUS]:.0f}, later {then[INSTANTANEOUS]:.1f}). {_CHOSEN}; MPC around "
        f"shooting.",
    )


def boundary_residual() -> Drawing:
    """Draw what is left of psi(t_f) at every step."""
    picture, columns, worst = sheet(9.0, 4.5), {}, {}
    axes = picture.subplots()
    for horizon, colour in zip((_SHORT, HORIZON, _LONG), COLOURS, strict=False):
        rollout = run("shooting", horizon)
        left = np.array([decision.residual for decision in rollout.decisions])
        axes.semilogy(rollout.t[:-1], left, ".-", color=colour, label=f"horizon {horizon:g} s")
        columns |= {"t [s]": rollout.t[:-1], f"psi(t_f), horizon {horizon:g} s [1/s]": left}
        worst[horizon] = left.max()
    axes.axhline(BOUND, **REFERENCE)
    label(axes, "time [s]", "max |ψ(t_f)|")
    axes.legend(fontsize=8)
    said = ", ".join(f"{value:.0e} at {horizon:g} s" for horizon, value in worst.items())
    return Drawing(
        picture,
        columns,
        f"Fig. 3.20: ψ(t_f) stays below {BOUND:g} at every step; the largest is {said}. {_CHOSEN}; "
        f"Newton stops at 1e-8, the thesis at {BOUND:g} (dashed).",
    )


def terminations() -> Drawing:
    """Draw how Schuetz' method ended at every step."""
    picture, columns, shares = sheet(9.0, 5.5), {}, {}
    names = list(dict.fromkeys(_ENDS.values()))
    for axes, horizon in zip(picture.subplots(3, 1, sharex=True), (_SHORT, HORIZON, _LONG),
                             strict=True):  # fmt: skip
        rollout = run("schuetz", horizon)
        ends = [_ENDS[d.status] for d in rollout.decisions if d.status]
        index = np.array([names.index(end) for end in ends])
        axes.plot(rollout.t[:-1], index, "o", ms=4, color=COLOURS[1])
        axes.set_yticks(range(len(names)), names, fontsize=8)
        axes.set_ylim(-0.5, len(names) - 0.5)
        label(axes, "time [s]" if horizon == _LONG else "", "", f"horizon {horizon:g} s")
        columns["t [s]"] = rollout.t[:-1]
        for i, name in enumerate(names):
            columns[f"ended by '{name}', horizon {horizon:g} s [0 or 1]"] = 1.0 * (index == i)
        shares[horizon] = np.mean(index == names.index("cost decrease below ε"))
    said = ", ".join(f"{100 * share:.0f} % at {horizon:g} s" for horizon, share in shares.items())
    return Drawing(
        picture,
        columns,
        f"Fig. 3.21: the share of steps that end because the cost decreases by less than ε = 1e-4 "
        f"is {said}. {_CHOSEN}; fixed step 0.01.",
    )
