"""The library as a table of Markdown: ``docs/library.md`` holds it, a test keeps it true."""

from collections.abc import Iterable

from benchmarks.cases import LIBRARY, PHASES, KnownOptimum, Reference

_HEAD = (
    "| case | difficulty | optimal cost | how | methods | published (error) |",
    "|---|---|---|---|---|---|",
)


def library_table() -> str:
    """Return a line for each case, in the order of the library."""
    return _table(LIBRARY)


def phases_table() -> str:
    """Return the same of the problems in phases."""
    return _table(PHASES)


def _table(cases: Iterable[KnownOptimum]) -> str:
    return "\n".join((*_HEAD, *map(_line, cases)))


def _line(case: KnownOptimum) -> str:
    published = "; ".join(
        f"{p.value:.10g}, {p.source} ({error:+.1e})"
        for p, error in zip(case.published, case.errors(), strict=True)
    )
    cells = (
        f"`{case.name}`",
        case.difficulty,
        _interval(case.reference),
        case.reference.how if case.reference else "",
        ", ".join(sorted(case.families)),
        published,
    )
    return f"| {' | '.join(cells)} |"


def _interval(reference: Reference | None) -> str:
    if reference is None:
        return ""
    if reference.error <= 2e-12 * max(1.0, abs(reference.value)):
        return f"{reference.value:.12g}"
    return f"{reference.value:.14g} ± {reference.error:.0e}"
