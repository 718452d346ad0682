"""The curves of a closed loop: what was, what its controller was told, wanted and planned."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ocp.loop_plotting.loop_record import LoopRecord
from ocp.loop_plotting.plans import sends_controls
from ocp.plotting.curve import Curve, Line
from ocp.plotting.curves import curves_along
from ocp.plotting.references import references_of
from ocp.plotting.run import Run
from ocp.plotting.trajectory import Trajectory, both_sides
from ocp.problem.ocp import OCP
from ocp.solution.shifted_plan import plan_controls
from ocp.solution.solution import Solution


def run_of(rollout: LoopRecord, plans: int) -> Run:
    """Return a closed loop as a run that is drawn.

    Args:
        rollout: with at least one step.
        plans: every how many steps the plan is drawn; 0: none.
    """
    plant = rollout.plant
    way = _way(rollout, plant)
    curves = list(curves_along(way))
    beside: dict[tuple[str, str], list[Line]] = {}
    for name, told, true in zip(
        plant.model.x_names, rollout.measured.T, rollout.x[:-1].T, strict=True
    ):
        if not np.array_equal(told, true):
            line = Line("measured", rollout.t[: len(told)], told, "measured")
            beside.setdefault(("state", name), []).append(line)
    for key, line in [*_wanted(rollout), *_planned(rollout, plans)]:
        beside.setdefault(key, []).append(line)
    curves = [_with(curve, beside.get((curve.role, curve.name), [])) for curve in curves]
    rates = rollout.costs / np.diff(rollout.t)
    curves.append(Curve("running cost", "", "cost", way.t, np.repeat(rates, 2)))
    return Run(plant.name, tuple(curves), (), rollout.t[[0, -1]])


def _with(curve: Curve, lines: list[Line]) -> Curve:
    """Return a curve with more lines; a reference that is known already stands there once."""
    known = {line.name for line in lines if line.kind == "reference"}
    own = [line for line in curve.lines if line.name not in known]
    return replace(curve, lines=(*own, *lines))


def _way(rollout: LoopRecord, ocp: OCP) -> Trajectory:
    """Return states and inputs of a loop, with the parameters that its controller knew."""
    u = np.vstack([rollout.inputs, rollout.inputs[-1:]])
    p = _parameters(rollout, ocp)
    before = np.vstack([rollout.inputs[:1], rollout.inputs])
    return Trajectory(
        ocp=ocp,
        t=both_sides(rollout.t, rollout.t),
        x=both_sides(rollout.x, rollout.x),
        u=both_sides(before, u),
        p=both_sides(np.vstack([p[:1], p[:-1]]), p),
    )


def _parameters(rollout: LoopRecord, ocp: OCP) -> np.ndarray:
    """Return what stands in p at every sampling instant, (K + 1, n_p).

    Of what decisions know by name theirs, of signals at the first instant of the horizon; else
    what is declared.
    """
    declared = ocp.parameter_values().at(0.0)[0]
    rows = np.tile(declared, (len(rollout.t), 1))
    for k, decision in enumerate(rollout.decisions[: len(rollout.t)]):
        first = 0
        for entry in ocp.entries:
            size = entry.symbol.numel()
            known = decision.parameters.get(entry.name)
            if known is not None and np.asarray(known).shape[-1:] == (size,):
                rows[k, first : first + size] = np.atleast_2d(known)[0]
            first += size
    if rollout.decisions:
        rows[len(rollout.decisions) :] = rows[len(rollout.decisions) - 1]
    return rows


def _wanted(rollout: LoopRecord) -> Iterator[tuple[tuple[str, str], Line]]:
    """Yield the references of the controller, where it has the plant's states and inputs."""
    plan = next((d.plan for d in rollout.decisions if d.plan is not None), None)
    m = rollout.plant.model
    if plan is None or not _is_alike(plan, rollout.plant):
        return
    way = _way(rollout, plan.problem)
    keys = [("state", n) for n in m.x_names] + [("control", n) for n in m.u_names]
    for place, (name, owner) in references_of(way).items():
        if owner < len(keys):
            yield keys[owner], Line(name, way.t, way.p[:, place])


def _is_alike(plan: Solution, plant: OCP) -> bool:
    own, m = plan.problem.model, plant.model
    return own.x_names == m.x_names and own.u_names == m.u_names


def _planned(rollout: LoopRecord, every: int) -> Iterator[tuple[tuple[str, str], Line]]:
    """Yield states and inputs of plans, where they are those of the plant."""
    if not every:
        return
    m, sends = rollout.plant.model, sends_controls(rollout)
    for decision in rollout.decisions[::every]:
        plan = decision.plan
        if plan is None:
            continue
        if plan.x.shape[1] == m.nx:
            for name, column in zip(m.x_names, plan.x.T, strict=True):
                yield ("state", name), Line("plan", plan.t, column, "plan")
        if sends:
            times = np.repeat(plan.t, 2)[1:-1]
            middle = (plan.t[1:] + plan.t[:-1]) / 2
            rows = np.repeat([plan_controls(plan, float(t)) for t in middle], 2, axis=0)
            for name, column in zip(m.u_names, rows.T, strict=True):
                yield ("control", name), Line("plan", times, column, "plan")
