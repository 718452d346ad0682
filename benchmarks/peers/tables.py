"""The comparison as tables: on the console and as Markdown for the docs."""

from collections.abc import Iterator

from rich.table import Table

from benchmarks.peers.entry import Entry, PeerReport
from benchmarks.sweep.row import FEASIBLE

_COLUMNS = (
    "who",
    "version",
    "cost",
    "gap",
    "violation",
    "cold ms",
    "warm ms",
    "cold ratio",
    "warm ratio",
    "remarks",
)
_WORDS = ("who", "version", "remarks")


def tables(report: PeerReport) -> Iterator[Table]:
    """Return a table for each job."""
    for job, title in report.titles.items():
        table = Table(title=title)
        for column in _COLUMNS:
            words = column in _WORDS
            table.add_column(column, justify="left" if words else "right", no_wrap=not words)
        for entry in _of(report, job):
            table.add_row(*_cells(entry))
        yield table


def markdown(report: PeerReport) -> str:
    """Return the same tables for a page of the docs."""
    blocks = []
    for job, title in report.titles.items():
        aligned = "|".join("---" if c in _WORDS else "---:" for c in _COLUMNS)
        lines = [f"### {title[0].upper()}{title[1:]}", "", f"| {' | '.join(_COLUMNS)} |"]
        lines += [f"|{aligned}|"]
        lines += [f"| {' | '.join(_escaped(c) for c in _cells(e))} |" for e in _of(report, job)]
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks) + "\n"


def quicker(report: PeerReport) -> list[str]:
    """Return a sentence for every peer that was quicker than ours with answers as good.

    As good: feasible for the referee in every solve, and no more than 0.1 % above our cost.
    """
    lines = []
    for entry in report.entries:
        if entry.ours or not _is_good(entry):
            continue
        for kind, ratio in (("cold", entry.cold_ratio), ("warm", entry.warm_ratio)):
            if ratio is not None and ratio < 1.0:
                lines.append(
                    f"{entry.contender} is quicker than ours on {entry.job}, {kind}: it takes "
                    f"{ratio:.2g} of the time of our quickest"
                )
    return lines


def _is_good(entry: Entry) -> bool:
    return (
        entry.outcome == "measured"
        and entry.good == entry.solves
        and entry.gap is not None
        and entry.gap < 1e-3
    )


def _of(report: PeerReport, job: str) -> list[Entry]:
    return [entry for entry in report.entries if entry.job == job]


def _cells(entry: Entry) -> list[str]:
    name = f"ours: {entry.contender}" if entry.ours else entry.contender
    if entry.outcome != "measured":
        return [name, _version(entry), *[""] * 7, f"{entry.outcome}: {entry.remark}"]
    times = (_number(entry.cold, 1e3, ".3g"), _number(entry.warm, 1e3, ".3g"))
    ratios = (_number(entry.cold_ratio, 1.0, ".2g"), _number(entry.warm_ratio, 1.0, ".2g"))
    # The cost of what violates a constraint says nothing, nor does the time it took.
    worth = entry.good == entry.solves
    ratios = ratios if worth else ("", "")
    numbers = (
        _number(entry.cost if worth else None, 1.0, ".7g"),
        _number(entry.gap if worth else None, 1.0, "+.1e"),
        _number(entry.violation, 1.0, ".0e"),
    )
    return [name, _version(entry), *numbers, *times, *ratios, _remarks(entry)]


def _version(entry: Entry) -> str:
    """The first version is that of the package itself."""
    return next(iter(entry.versions.values()), "")


def _remarks(entry: Entry) -> str:
    remarks = [entry.remark] if entry.remark else []
    if not entry.status.startswith("solved"):
        remarks.append(f"its own word: {entry.status}")
    if entry.good < entry.solves:
        remarks.append(
            f"{entry.solves - entry.good} of {entry.solves} answers violate a constraint by more "
            f"than {FEASIBLE:g}"
        )
    return "; ".join(remarks)


def _number(value: float | None, scale: float, form: str) -> str:
    return "" if value is None else format(scale * value, form)


def _escaped(cell: str) -> str:
    return cell.replace("|", "/").replace("<", "&lt;")
