"""``list``: suites, cases and solvers."""

from argparse import Namespace

from rich.console import Console
from rich.table import Table

from benchmarks.cases import all_cases
from benchmarks.commands.command import Command, no_options
from benchmarks.methods.every import all_methods


def _run(options: Namespace, console: Console) -> int:
    console.print(_suites())
    console.print(_solvers())
    return 0


def _suites() -> Table:
    table = Table("suite", "cases", "of them with a reference")
    for suite in dict.fromkeys(case.suite for case in all_cases()):
        members = [case for case in all_cases() if case.suite == suite]
        known = sum(case.reference is not None for case in members)
        names = f"{members[0].name} ... {members[-1].name} ({len(members)})"
        table.add_row(suite, names, str(known))
    return table


def _solvers() -> Table:
    table = Table("solver", "suites", "runs on cases that declare", "what")
    for method in all_methods():
        table.add_row(method.name, " ".join(sorted(method.suites)), method.family, method.about)
    return table


LIST = Command("list", "suites, cases and solvers", no_options, _run)
