"""Fig. 3.10: with an obstacle; what looked like noise, resolved, and its extremals marked."""

import numpy as np

from benchmarks.cases import arm_scenario
from benchmarks.figures.drawing import COLOURS, Drawing, label, sheet
from benchmarks.figures.scanned import PLACE, columns, once, place, style, transversality
from solvers import enumerate_extremals

_SCENARIO = "arm-001"
# As many end configurations as a picture of the thesis has, about.
_COARSE = 68


def with_obstacle() -> Drawing:
    """Draw cost, transversality and distance from the start over the end configuration."""
    scenario = arm_scenario(_SCENARIO)
    free = enumerate_extremals(scenario.ocp("sum", free_start=True), spacing=0.2)
    given = enumerate_extremals(scenario.ocp("sum"), spacing=0.2)
    (scan,) = free.scans
    periods = scan.curve.manifold.periods
    away = np.linalg.norm(periods.wrapped(scan.starts - np.array(scenario.theta0)), axis=1)
    norms = transversality(free)
    even = np.linspace(0.0, scan.curve.length, _COARSE)
    coarse = np.unique(np.searchsorted(scan.arc, even).clip(0, len(scan.arc) - 1))
    picture = sheet(11.0, 9.6)
    axes = picture.subplots(3, 1, sharex=True)
    for place_, values in zip(axes, (scan.costs, norms, away), strict=True):
        place_.plot(scan.arc[coarse], values[coarse], "-", color="0.7", label=f"{_COARSE} points")
        place_.plot(scan.arc, values, color=COLOURS[0], lw=1.0, label=f"{len(scan.arc)} points")
        place_.set_yscale("log")
        place_.margins(y=0.25)
    for found, rows, bottom in ((free, axes[:2], norms), (given, axes[2:], away)):
        floor = bottom[bottom > 0.0].min()
        for solution in found.solutions:
            marker, arc = style(solution, found), place(scan, solution)
            rows[0].plot(arc, solution.cost if found is free else floor, **marker)
            if found is free:
                rows[1].plot(arc, floor, **marker)
    for place_ in axes:
        place_.legend(*once(place_), fontsize=8, loc="upper center", ncols=2)
    label(axes[0], "", "cost [rad²/s]", "type 3: free start")
    label(axes[1], "", "‖N ψ(t_0)‖ [1/s]")
    label(axes[2], PLACE, "‖θ_int − θ_0‖ [rad]", "type 4: the start is given")
    sentence = (
        "Fig. 3.10: with the obstacle the curves are no noise: they are smooth, with sharp folds "
        f"that a coarse scan jumps over (grey). Type 3 has {len(free.solutions)} extremals, "
        f"{len(free.minima)} of them minima, the best at {free.costs[0]:.6f}; from the given start "
        f"there are {len(given.solutions)}, {len(given.minima)} of them minima, at costs "
        f"{', '.join(f'{s.cost:.3f}' for s in given.minima[:4])}. Marks lie at the foot of the "
        f"lower curves, where these reach zero. Chosen here: {_SCENARIO} with p_0 summed over "
        "the links."
    )
    data = columns(scan, {"‖N ψ(t_0)‖ [1/s]": norms, "‖θ_int − θ_0‖ [rad]": away})
    for name, found in (("type 3", free), ("type 4", given)):
        order = found.solutions
        data[f"extremals of {name}, arclength [rad]"] = np.array([place(scan, s) for s in order])
        data[f"extremals of {name}, cost [rad²/s]"] = found.costs
        data[f"extremals of {name}, minimum [-]"] = np.array(
            [float(any(s is m for m in found.minima)) for s in order]
        )
    return Drawing(picture, data, sentence)
