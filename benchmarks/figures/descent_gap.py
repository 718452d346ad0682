"""Schuetz' gap to the certified optimum over its step and over its start (thesis 3.2.6)."""

import numpy as np
from matplotlib.axes import Axes

from benchmarks.cases import Case, all_cases
from benchmarks.figures.drawing import COLOURS, FINITE, REFERENCE, Drawing, label, sheet
from ocp import Status, evaluate
from solvers import FixedStep, Schuetz, random_guesses

# What the thesis reports for Schuetz against shooting (3.2.6) [%].
THESIS = 6.5784
_STEPS = (0.003, 0.01, 0.03, 0.05, 0.07, 0.1, 0.14, 0.2)
_MARKED = ("arm-001-closest", "arm-003-closest")
_STARTS, _SEED, _AMPLITUDE = 5, 0, 3.0
_ACCURACY = 1e-6  # of the referee's costs, relative
_FLOOR = 1e-3  # smaller gaps are drawn here [%]
_CHOSEN = (
    "Chosen here: the 36 scenarios whose optimum with the closest link's cost is certified, "
    "75 Euler steps of 0.02 s, termination tests as in the thesis (epsilon = 1e-4)"
)


def over_step() -> Drawing:
    """Draw the gap over alpha."""
    cases = _certified()
    found = [[_gaps(case, Schuetz(step=FixedStep(a)))[0] for a in _STEPS] for case in cases]
    gaps = np.array([[gap for gap, _ in row] for row in found])
    rose = np.array([[status is Status.COST_ROSE for _, status in row] for row in found])
    picture = sheet(12.0, 4.8)
    left, right = picture.subplots(1, 2)
    for row in gaps:
        left.loglog(_STEPS, np.maximum(row, _FLOOR), color="lightgray", lw=0.8)
    for name, colour in zip(_MARKED, COLOURS, strict=False):
        row = gaps[[case.name for case in cases].index(name)]
        left.loglog(_STEPS, np.maximum(row, _FLOOR), ".-", color=colour, label=name[:7])
    left.loglog(_STEPS, np.median(gaps, axis=0), "o-", color=FINITE, lw=2, label="median")
    left.axhline(THESIS, label="thesis: 6.58 %", **REFERENCE)
    label(left, "step length alpha", "cost above the optimum [%]", "each line a scenario")
    left.legend(fontsize=8)
    right.semilogx(_STEPS, 100.0 * rose.mean(axis=0), "o-", color=FINITE)
    label(right, "step length alpha", "stopped by a rise [% of scenarios]", "why it stopped")
    at = {a: i for i, a in enumerate(_STEPS)}
    good, bad = at[0.01], at[0.1]
    ones = {name: gaps[[case.name for case in cases].index(name)] for name in _MARKED}
    sentence = (
        f"Fig. 3.13b: the gap is a matter of alpha. At alpha = 0.01 its median is "
        f"{np.median(gaps[:, good]):.2f} % and {int(rose[:, good].sum())} of {len(cases)} descents "
        f"are stopped by a rise; at alpha = 0.1 it is {np.median(gaps[:, bad]):.1f} %, and "
        f"{int(rose[:, bad].sum())} are. "
        + "; ".join(
            f"{name[:7]}: {gap[good]:.2f} % at 0.01, {gap[bad]:.1f} % at 0.1"
            for name, gap in ones.items()
        )
        + f". {_CHOSEN}, start at y = 0 and the regularised cost."
    )
    columns = {"alpha [-]": np.array(_STEPS)}
    columns |= {f"gap of {c.name} [%]": row for c, row in zip(cases, gaps, strict=True)}
    columns["stopped by a rise [%]"] = 100.0 * rose.mean(axis=0)
    return Drawing(picture, columns, sentence)


def over_start(starts: int = _STARTS, few: int | None = None) -> Drawing:
    """Draw the gap over different first guesses of y, on all scenarios or the first few."""
    cases = _certified()[:few]
    solvers = {
        "Algorithm 2, alpha = 0.1": Schuetz(step=FixedStep(0.1)),
        "Algorithm 2, alpha = 0.01": Schuetz(step=FixedStep(0.01)),
        "line search and restarts": Schuetz.sound(),
    }
    gaps = {
        name: np.array([[gap for gap, _ in _gaps(case, solver, starts)] for case in cases])
        for name, solver in solvers.items()
    }
    picture = sheet(12.0, 4.8)
    left, right = picture.subplots(1, 2)
    columns = {}
    for (name, all_gaps), colour in zip(gaps.items(), (FINITE, *COLOURS), strict=False):
        _shares(left, all_gaps.ravel(), colour, name)
        _shares(right, all_gaps.min(axis=1), colour, name)
        columns[f"gap, {name} [%]"] = all_gaps.ravel()
    label(left, "cost above the optimum [%]", "share of all descents [%]", "each start by itself")
    label(right, "cost above the optimum [%]", "share of scenarios [%]", f"best of {starts}")
    left.legend(fontsize=8, loc="lower right")
    sound, small = gaps["line search and restarts"], gaps["Algorithm 2, alpha = 0.01"]
    best = sound.min(axis=1)
    sentence = (
        f"Fig. 3.13c: different starts end at different costs. With a line search nothing is left "
        f"of that but the basins: {100 * (sound > 1.0).mean():.0f} % of the descents end more than "
        f"1 % above the optimum, all others within {sound[sound <= 1.0].max():.1g} %. Algorithm 2 "
        f"with alpha = 0.01 adds descents that stop early: {100 * (small > 1.0).mean():.0f} %. Of "
        f"the best of {starts} starts with a line search {100 * (best > 1.0).mean():.0f} % do. "
        f"{_CHOSEN}; start 1 is y = 0, the others are smooth random y with a standard deviation of "
        f"{_AMPLITUDE:g} rad/s."
    )
    return Drawing(picture, columns, sentence)


def _certified() -> list[Case]:
    return [
        case
        for case in all_cases()
        if case.suite == "arm" and case.name.endswith("closest") and case.reference is not None
    ]


def _gaps(case: Case, solver: Schuetz, starts: int = 1) -> list[tuple[float, Status]]:
    """The referee's gap [%] and how the descent ended, for each start."""
    ocp, found = case.build(), []
    program = solver.build(ocp)
    for guess in (None, *random_guesses(ocp, starts - 1, _SEED, _AMPLITUDE)):
        solution = program.run(guess=guess)
        gap = case.gap(evaluate(solution, tolerance=_ACCURACY).cost)
        assert gap is not None
        found.append((100.0 * gap, solution.status))
    return found


def _shares(axes: Axes, gaps: np.ndarray, colour: str, name: str) -> None:
    """Draw which share of the gaps lies below a value."""
    ordered = np.sort(np.maximum(gaps, _FLOOR))
    axes.semilogx(ordered, 100.0 * np.arange(1, len(ordered) + 1) / len(ordered), drawstyle="steps",
                  color=colour, label=name)  # fmt: skip
    axes.axvline(THESIS, **REFERENCE)
