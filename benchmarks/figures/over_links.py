"""Gap and effort over the number of links, for random arms of 3 to 12."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from benchmarks.cases import Case, link_cases
from benchmarks.figures.drawing import COLOURS, FINITE, Drawing, label, sheet
from ocp import Solution, evaluate, solve
from solvers import IndirectShooting, MultipleShooting, Schuetz

NUMBERS, PER_NUMBER = (3, 6, 9, 12), 2
_ACCURACY = 1e-7  # of the referee's costs, relative
_FLOOR = 1e-5  # smaller gaps are drawn here [%]
DIRECT, SCHUETZ, INDIRECT = "direct, 75 intervals", "Schuetz, line search", "indirect, from direct"
_STYLES = {DIRECT: (FINITE, "o"), SCHUETZ: (COLOURS[2], "^"), INDIRECT: (COLOURS[0], "s")}


@dataclass(frozen=True)
class _Found:
    """What a method did on one case: gap [%] or NaN without success, time [s], integrations."""

    gap: float
    time: float
    work: int


def links(cases: Sequence[Case] | None = None) -> Drawing:
    """Draw gap to the best known cost, solve time and integrations over the number of links."""
    chosen = _few() if cases is None else cases
    found = [_compared(case) for case in chosen]
    numbers = np.array([case.build().model.nx for case in chosen])
    picture = sheet(14.0, 4.8)
    axes = picture.subplots(1, 3)
    columns = {"links [-]": numbers}
    for method, (colour, mark) in _STYLES.items():
        gap, time, work = (
            np.array([getattr(row[method], name) for row in found])
            for name in ("gap", "time", "work")
        )
        for axis, values in zip(axes, (np.maximum(gap, _FLOOR), time, work), strict=True):
            _medians(axis, numbers, values, colour, mark, method)
        columns[f"gap, {method} [%]"] = gap
        columns[f"solve time, {method} [s]"] = time
        columns[f"integrations, {method} [-]"] = work
    label(axes[0], "links", "cost above the best known [%]", "each mark an arm, lines medians")
    label(axes[1], "links", "solve time [s]", "without building")
    label(axes[2], "links", "integrations of the trajectory", "roll-outs and derivative sweeps")
    axes[0].legend(fontsize=8)
    return Drawing(picture, columns, _sentence(columns))


def _few() -> list[Case]:
    """The first cases of some numbers of links of the suite ``links``."""
    wanted = {f"arm-{n:02d}-links-{i}" for n in NUMBERS for i in range(PER_NUMBER)}
    return [case for case in link_cases() if case.name in wanted]


def _compared(case: Case) -> dict[str, _Found]:
    ocp = case.build()
    direct = solve(ocp, MultipleShooting(75))
    answers = {
        DIRECT: direct,
        SCHUETZ: solve(ocp, Schuetz.sound()),
        INDIRECT: solve(ocp, IndirectShooting(segments=15), guess=direct),
    }
    costs = {method: _cost(answer) for method, answer in answers.items()}
    best = np.nanmin(list(costs.values()))
    return {
        method: _Found(
            100.0 * (costs[method] / best - 1.0),
            answer.solve_time,
            answer.work.rollouts + answer.work.jacobians,
        )
        for method, answer in answers.items()
    }


def _cost(solution: Solution) -> float:
    """The referee's cost of a success, NaN of a failure."""
    success = solution.status.is_success
    return evaluate(solution, tolerance=_ACCURACY).cost if success else np.nan


def _medians(
    axis: Axes, numbers: np.ndarray, values: np.ndarray, colour: str, mark: str, name: str
) -> None:
    each = np.unique(numbers)
    middle = [np.nanmedian(v) if np.isfinite(v := values[numbers == n]).any() else np.nan
              for n in each]  # fmt: skip
    axis.semilogy(numbers, values, mark, color=colour, ms=4, alpha=0.5)
    axis.semilogy(each, middle, color=colour, label=name)


def _sentence(columns: dict[str, np.ndarray]) -> str:
    numbers = columns["links [-]"]
    few, many = numbers == numbers.min(), numbers == numbers.max()

    def ratio(what: str, method: str) -> float:
        values = columns[f"{what}, {method} [{'s' if 'time' in what else '-'}]"]
        return float(np.median(values[many]) / np.median(values[few]))

    def best(method: str) -> int:
        return int((columns[f"gap, {method} [%]"] <= 1.0).sum())

    solved = int(np.isfinite(columns[f"gap, {INDIRECT} [%]"]).sum())
    return (
        f"Fig. links: of {len(numbers)} random arms direct multiple shooting from its own start "
        f"comes within 1 % of the best known cost on {best(DIRECT)}, Schuetz with a line search on "
        f"{best(SCHUETZ)}, indirect multiple shooting from the direct answer on {best(INDIRECT)} "
        f"(it solves {solved}). From {numbers.min()} to {numbers.max()} links the time grows by "
        f"{ratio('solve time', DIRECT):.1f}, {ratio('solve time', SCHUETZ):.1f} and "
        f"{ratio('solve time', INDIRECT):.1f} times; the number of integrations by "
        f"{ratio('integrations', DIRECT):.1f}, {ratio('integrations', SCHUETZ):.1f} and "
        f"{ratio('integrations', INDIRECT):.1f}. "
        f"Chosen here: {PER_NUMBER} scenarios for each number of links, total length 3 m, "
        f"1.5 s, the cost summed over the links; best known: of the three methods. "
        "What is missing did not converge."
    )
