"""Who solves how much, judged by residuals."""

from collections.abc import Sequence

from benchmarks.report.level import LEVELS, LOW, ReportLevel
from benchmarks.report.rows import Part, parts_of
from benchmarks.report.section import Block, Section, Text
from benchmarks.report.sheet import Cell, Sheet
from benchmarks.sweep.row import Row
from ocp import Status

_HOW = (
    "A row counts as a success by what the referee measures when it integrates the controls "
    "itself, whatever the solver says: the violation of every constraint, and the distance of "
    "the cost from the reference, or the residual of the minimum principle where no reference is "
    f"known. “Claims more” counts rows that a solver calls solved and the level “{LOW.name}” "
    "refuses, “claims less” the opposite; “undecided” have neither reference nor residual."
)


def success(rows: Sequence[Row]) -> Section:
    """Return the section on how much is solved."""
    blocks: list[Block] = [Text(_HOW), _thresholds()]
    for part in parts_of(rows):
        blocks += [Text(part.title, "heading"), _counts(part)]
    return Section("success", "Success, by residuals", blocks)


def _thresholds() -> Sheet:
    columns = (
        "level",
        "violation ≤ [its unit]",
        "|gap| ≤, relative",
        "else stationarity ≤ [unit of u]",
    )
    lines = [(level.name, level.violation, level.gap, level.stationarity) for level in LEVELS]
    return Sheet("levels", columns, lines)


def _counts(part: Part) -> Sheet:
    levels = [f"{level.name} [%]" for level in LEVELS]
    columns = ("method", "rows", *levels, "undecided", "claims more", "claims less", "lost")
    lines = [_line(method, part.of(method)) for method in part.methods]
    return Sheet(f"success-{part.name}", columns, lines)


def _line(method: str, rows: Sequence[Row]) -> list[Cell]:
    low = [(claims(row), LOW.met_by(row)) for row in rows]
    return [
        method,
        len(rows),
        *(share(level, rows) for level in LEVELS),
        sum(met is None for _, met in low),
        sum(claim and met is False for claim, met in low),
        sum(bool(met) and not claim for claim, met in low),
        sum(row.is_lost for row in rows),
    ]


def share(level: ReportLevel, rows: Sequence[Row]) -> float | None:
    """Return the percentage of the rows that can be judged which meet a level."""
    met = [level.met_by(row) for row in rows]
    judged = [one for one in met if one is not None]
    return round(100.0 * sum(judged) / len(judged), 1) if judged else None


def claims(row: Row) -> bool:
    """Whether the solver itself calls its answer a success."""
    return row.status in Status.__members__ and Status[row.status].is_success
