"""Fig. 2.8 and 2.9: generalised predictive control with longer and longer horizons."""

from functools import cache

import numpy as np

from benchmarks.figures.drawing import COLOURS, FINITE, REFERENCE, Drawing, held, label, sheet
from models import Carima, CarimaPlant
from solvers import GPC, GPCLaw, GPCRun, gpc_loop

MODEL = Carima([1.0, -0.8], [0.4, 0.6])  # (2.79) to (2.81)
WEIGHT = 0.8
_AT, _STEPS, _LONGEST = 5, 50, 30
_DRAWN = (1, 2, 3, 5, _LONGEST)
_CHOSEN = (
    f"Chosen here: the reference steps from 0 to 1 at t = {_AT}, {_STEPS} steps, "
    f"lambda = {WEIGHT:g}"
)


def outputs() -> Drawing:
    """Draw output and input for some horizons."""
    runs = {n: run(n, preview=False) for n in _DRAWN}
    picture, t = sheet(11.0, 5.0), np.arange(_STEPS + 1)
    left, right = picture.subplots(1, 2)
    columns = {"t [steps]": t, "reference [-]": runs[1].reference}
    left.step(t, runs[1].reference, where="post", label="reference", **REFERENCE)
    for (n, loop), colour in zip(runs.items(), (*COLOURS, FINITE), strict=True):
        style = {"lw": 4.5, "alpha": 0.5, "zorder": 1} if n == _LONGEST else {"lw": 1.5}
        style |= {"color": colour, "label": f"N = {n}"}
        left.plot(t, loop.y, **style)
        held(right, np.append(t, t[-1] + 1)[: len(loop.u) + 1], loop.u, **style)
        columns |= {f"y, N = {n} [-]": loop.y, f"u, N = {n} [-]": loop.u}
    label(left, "time [steps]", "output y")
    label(right, "time [steps]", "input u")
    for axes in (left, right):
        axes.set_xlim(0, 30)
        axes.legend(fontsize=8)
    over = ", ".join(f"{100 * (loop.y.max() - 1):.1f} % at N = {n}" for n, loop in runs.items())
    sentence = (
        f"Fig. 2.8: short horizons overshoot: {over}. {_CHOSEN}; the step "
        "is seen one step ahead; 30 of the steps are drawn."
    )
    return Drawing(picture, columns, sentence)


def costs() -> Drawing:
    """Draw the total cost over the horizon."""
    horizons = np.arange(1, _LONGEST + 1)
    known, unknown = (np.array([run(n, preview=p).cost for n in horizons]) for p in (True, False))
    picture = sheet(11.0, 4.8)
    left, right = picture.subplots(1, 2)
    for values, name, colour in (
        (unknown, "reference seen one step ahead", COLOURS[1]),
        (known, "reference seen over the horizon", FINITE),
    ):
        left.plot(horizons, values, ".-", color=colour, label=name)
        right.semilogy(horizons[:-1], _excess(values)[:-1], ".-", color=colour, label=name)
    label(left, "horizon N [steps]", "total cost")
    label(right, "horizon N [steps]", "excess", f"cost(N) / cost({_LONGEST}) - 1")
    left.set_ylim(bottom=0.0)
    for axes in (left, right):
        axes.legend(fontsize=8)
    sentence = (
        f"Fig. 2.9: the total cost converges fast: cost(1) / cost({_LONGEST}) = "
        f"{known[0] / known[-1]:.3f}, cost(5) / cost({_LONGEST}) = {known[4] / known[-1]:.5f} "
        f"(reference seen over the horizon) and {unknown[0] / unknown[-1]:.3f}, "
        f"{unknown[4] / unknown[-1]:.5f} (one step ahead). {_CHOSEN}."
    )
    columns = {
        "N [steps]": horizons,
        "cost, reference seen over the horizon [-]": known,
        "cost, reference seen one step ahead [-]": unknown,
    }
    return Drawing(picture, columns, sentence)


def law(n: int) -> GPCLaw:
    """Return the law with horizon n."""
    return GPC(n2=n, weight=WEIGHT).build(MODEL)


@cache
def run(n: int, *, preview: bool) -> GPCRun:
    """Return the closed loop with horizon n behind a step of the reference."""
    reference = np.concatenate([np.zeros(_AT), np.ones(_STEPS + _LONGEST)])
    return gpc_loop(law(n), CarimaPlant(MODEL), reference, _STEPS, preview=preview)


def _excess(values: np.ndarray) -> np.ndarray:
    """Above the last one, relative; what is below rounding is not drawn."""
    above = values / values[-1] - 1.0
    return np.where(above > 1e-15, above, np.nan)
