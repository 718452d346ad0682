"""Fig. 3.6: Newton's steps towards psi(t1) = 0 in single shooting."""

from dataclasses import replace

import numpy as np

from benchmarks.cases import all_cases, arm_scenario
from benchmarks.figures.drawing import COLOURS, Drawing, label, sheet
from ocp import Guess, Solution, evaluate, solve
from solvers import IndirectShooting

_SCENARIO = "arm-001"
_HORIZONS = (0.5, 1.0, 1.5)  # [s]
# The thesis' guess in the sign of the minimum principle: its (0, -10, 10).
_GUESS = (0.0, 10.0, -10.0)
_TOLERANCE = 1e-8


def convergence() -> Drawing:
    """Draw the norm of psi(t1) over the steps, undamped (3.50) and damped."""
    picture, columns = sheet(11.0, 4.4), {}
    runs = {}
    for axes, damped in zip(picture.subplots(1, 2, sharey=True), (False, True), strict=True):
        word = "damped" if damped else "undamped"
        for colour, horizon in zip(COLOURS, _HORIZONS, strict=False):
            solution = runs[word, horizon] = _solved(horizon, damped=damped)
            residual = np.asarray(solution.history["residual"])
            success = "" if solution.status.is_success else ", fails"
            axes.semilogy(residual, "-o", ms=3, color=colour, label=f"{horizon:g} s{success}")
            columns[f"norm of psi(t1), {horizon:g} s, {word} [-]"] = residual
        label(axes, "Newton step", "max norm of ψ(t1)", word)
        axes.legend(fontsize=8)
    return Drawing(picture, columns, _sentence(runs))


def _solved(horizon: float, *, damped: bool) -> Solution:
    ocp = replace(arm_scenario(_SCENARIO), horizon=horizon).ocp("sum")
    solver = IndirectShooting(damped=damped, tolerance=_TOLERANCE)
    return solve(ocp, solver, guess=Guess(costate=_GUESS))


def _sentence(runs: dict[tuple[str, float], Solution]) -> str:
    steps = ", ".join(f"{runs['undamped', h].iterations} at {h:g} s" for h in _HORIZONS)
    best = next(
        c.reference.value for c in all_cases() if c.name == f"{_SCENARIO}-sum" and c.reference
    )
    long, tamed = runs["undamped", _HORIZONS[-1]], runs["damped", _HORIZONS[-1]]
    return (
        f"Fig. 3.6: undamped Newton steps: {steps}, at the longest horizon wandering about for "
        "most of them; a zero of ψ(t1) is no optimum: the extremal found at "
        f"{_HORIZONS[-1]:g} s costs {evaluate(long).cost:.1f}, the optimum {best:.2f}. Damped, "
        f"the same guess ends as {tamed.status.name.replace('_', ' ').lower()} there after "
        f"{tamed.iterations} steps. Chosen here: {_SCENARIO}, the sum over links, "
        f"ψ(t0) = {_GUESS} in the sign of the minimum principle, exact Jacobian, 300 RK4 steps."
    )
