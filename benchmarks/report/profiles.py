"""Performance profiles [Dolan & More 2002]: how often a method is the best, and how far behind."""

from collections.abc import Callable, Sequence

from benchmarks.report.level import LOW
from benchmarks.report.plot import Plot
from benchmarks.report.rows import Part, parts_of, time_of
from benchmarks.report.section import Block, Section, Text, missing
from benchmarks.report.steps import staircases
from benchmarks.sweep.row import Row

Setting = tuple[str, str, int, int]

_HOW = (
    "Over τ, the share of the cases on which a method needs at most τ times what the best method "
    "needs there [Dolan & More 2002]: at τ = 1 how often it is the best, far right how much it "
    f"solves at all, by the level “{LOW.name}” of the table above. Only cases that all methods "
    "have been run on count. Once for the solve time, once for integrations of the trajectory "
    "and of its derivatives, which no machine changes."
)


def profiles(rows: Sequence[Row]) -> Section:
    """Return the section of performance profiles."""
    blocks: list[Block] = [Text(_HOW)]
    for part in parts_of(rows):
        blocks += _part(part)
    return Section("profiles", "Performance profiles", blocks)


def _part(part: Part) -> list[Block]:
    shared = _shared(part)
    if len(part.methods) < 2 or not shared:
        reason = "one method only" if len(part.methods) < 2 else "no case that all methods have run"
        return [missing(f"{part.title}: {reason}, so there is nothing to compare.")]
    title = f"{part.title}, {len(shared)} cases"
    return [
        _profile(part, shared, "time", f"{title}: solve time", time_of),
        _profile(part, shared, "work", f"{title}: integrations", _work),
    ]


def _work(row: Row) -> float:
    """Integrations; a method that needs none has at least looked."""
    return max(row.rollouts + row.jacobians, 1)


def _shared(part: Part) -> set[Setting]:
    """The cases, with starts and seed, that every method has a row of."""
    return set.intersection(*({row.setting for row in part.of(m)} for m in part.methods))


def _profile(
    part: Part, shared: set[Setting], what: str, title: str, measure: Callable[[Row], float]
) -> Plot:
    ratios = ratios_to_best([row for row in part.rows if row.setting in shared], measure)
    return staircases(
        f"profile-{part.name}-{what}",
        title,
        {method: ratios.get(method, []) for method in part.methods},
        dict.fromkeys(part.methods, len(shared)),
        part.colours,
        axis="τ, times the best",
        first=1.0,
    )


def ratios_to_best(rows: Sequence[Row], measure: Callable[[Row], float]) -> dict[str, list[float]]:
    """Return r = measure / least measure on that case, by method, of the rows that succeed."""
    good = [row for row in rows if LOW.met_by(row)]
    best: dict[Setting, float] = {}
    for row in good:
        best[row.setting] = min(measure(row), best.get(row.setting, float("inf")))
    ratios: dict[str, list[float]] = {}
    for row in good:
        ratios.setdefault(row.solver, []).append(measure(row) / best[row.setting])
    return ratios
