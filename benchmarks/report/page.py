"""The page: all sections in one file that asks no network for anything."""

from collections.abc import Callable, Sequence

from jinja2 import Environment, PackageLoader, StrictUndefined

from benchmarks.report.borne_out import borne_out
from benchmarks.report.failures import failures
from benchmarks.report.gaps import gaps
from benchmarks.report.growth import growth
from benchmarks.report.level import LEVELS
from benchmarks.report.limitations import limitations
from benchmarks.report.overview import overview
from benchmarks.report.plot import power_of_ten
from benchmarks.report.profiles import profiles
from benchmarks.report.reaching import reaching
from benchmarks.report.section import Section
from benchmarks.report.success import share, success
from benchmarks.sweep.row import Row

SECTIONS: tuple[Callable[[Sequence[Row]], Section], ...] = (
    overview,
    success,
    gaps,
    reaching,
    profiles,
    growth,
    borne_out,
    failures,
    limitations,
)


def report_page(rows: Sequence[Row], notes: Sequence[str], title: str) -> str:
    """Return the report on the rows as HTML.

    Args:
        rows: at least one.
        notes: what is to be said about the folder, such as lines that are no rows.
        title: of the page.
    """
    environment = Environment(
        loader=PackageLoader("benchmarks", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    sections = [section(rows) for section in SECTIONS]
    return environment.get_template("page.html").render(
        title=title, notes=notes, sections=sections, facts=_facts(rows)
    )


def _facts(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """What to know first: (number, what it counts)."""
    solved = [
        (share(level, rows), f"gap\u00a0≤\u00a0{power_of_ten(level.gap)}") for level in LEVELS
    ]
    return [
        (str(len(rows)), "rows"),
        (str(len({(row.suite, row.case) for row in rows})), "cases"),
        (str(len({row.solver for row in rows})), "methods"),
        *((f"{one:.0f} %" if one is not None else "–", f"solved, {name}") for one, name in solved),
        (str(sum(row.is_lost for row in rows)), "lost"),
    ]
