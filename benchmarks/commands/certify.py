"""``certify``: the reference values of the library, each with its evidence."""

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.cases import LIBRARY, PHASES, Case, PhasesCase, all_cases
from benchmarks.cases.library.certificates import COMMITTED, Certificates
from benchmarks.cases.library.certify_case import certify_case
from benchmarks.commands.command import Command
from benchmarks.commands.options import named, positive
from benchmarks.sweep.row import versions
from ocp import OCPError
from solvers import CertifyOptions


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--case", nargs="+", default=[], metavar="C", help="names; none: library")
    parser.add_argument("--starts", type=positive, default=5, metavar="K", help="random starts")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--file", type=Path, default=COMMITTED, help="where they are written")
    parser.add_argument("--again", action="store_true", help="those on file too")


def _run(options: Namespace, console: Console) -> int:
    try:
        on_file = Certificates.read(options.file)
        effort = CertifyOptions(starts=options.starts, seed=options.seed)
    except (ValueError, OCPError) as reason:
        print(reason, file=sys.stderr)
        return 2
    wanted = _wanted(options.case)
    anew = options.again or options.case
    cases = [case for case in wanted if anew or case.name not in on_file.entries]
    failed = [c.name for c in wanted if c not in cases and not on_file.entries[c.name]["holds"]]
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("certificates", total=len(cases))
        for case in cases:
            try:
                certificate = certify_case(case, effort)
            except OCPError as reason:
                bar.console.print(f"{case.name}: not certified: {reason}", highlight=False)
                failed.append(case.name)
            else:
                bar.console.print(str(certificate), highlight=False, soft_wrap=True)
                on_file = on_file.with_(case.name, certificate.as_dict(), versions())
                on_file.write(options.file)
                failed += [] if certificate.holds else [case.name]
            bar.advance(task)
    console.print(_table(wanted, on_file))
    console.print(f"certificates: {options.file}")
    if failed:
        console.print(f"NOT certified: {', '.join(failed)}")
    return int(bool(failed))


def _wanted(names: list[str]) -> list[Case | PhasesCase]:
    if names:
        return named((*all_cases(), *PHASES), names, "case", by_beginning=True)
    return [*LIBRARY, *PHASES]


def _table(cases: list[Case | PhasesCase], on_file: Certificates) -> Table:
    """One line a case, and one more for each published value."""
    table = Table(title="certified values, and what is in print")
    for column in ("case", "certified", "+-", "digits", "published", "its error", "source"):
        justify = "left" if column in ("case", "source") else "right"
        table.add_column(column, justify=justify)
    for case in cases:
        entry = on_file.entries.get(case.name)
        if entry is None:
            table.add_row(case.name, "-", "", "", "", "", "")
            continue
        lower, upper = entry["interval"]
        certified = f"{entry['cost']:.10g}" if entry["holds"] else f"({entry['cost']:.10g})"
        first = (case.name, certified, f"{(upper - lower) / 2:.0e}", f"{entry['digits']:.1f}")
        printed = [
            (f"{p.value:.8g}", f"{(p.value - entry['cost']) / abs(entry['cost']):+.1e}", p.source)
            for p in case.published
        ] or [("", "", "")]
        for row, published in enumerate(printed):
            table.add_row(*(first if row == 0 else ("", "", "", "")), *published)
    return table


CERTIFY = Command("certify", "reference values, with everything they stand on", _options, _run)
