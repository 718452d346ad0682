"""``report``: a results folder as one page."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from rich.console import Console

from benchmarks.commands.command import Command
from benchmarks.report import report_page
from benchmarks.sweep.row import RESULTS
from benchmarks.sweep.rows_file import read_found
from ocp.internal import write_file


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="DIR", help="results of `run` or `bench`")
    parser.add_argument("--out", type=Path, metavar="FILE", help="default: report.html in DIR")


def _run(options: Namespace, console: Console) -> int:
    def say(note: str) -> None:
        console.print(note, markup=False, highlight=False, soft_wrap=True)

    file = options.folder / RESULTS
    found = read_found(file)
    notes = found.notes(file)
    for note in notes:
        say(note)
    if not found.rows:
        say(f"there is no row to report in {file}")
        return 2
    page: Path = options.out or options.folder / "report.html"
    try:
        write_file(page, report_page(found.rows, notes, "Benchmarks").encode())
    except OSError as wrong:
        say(f"the report cannot be written: {wrong}")
        return 2
    say(f"report: {page}")
    return 0


REPORT = Command("report", "a results folder as one HTML page", _options, _run)
