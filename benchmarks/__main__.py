"""Command line: ``python -m benchmarks``; with ``--help`` it says what it can do."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.arm_speed import INTERVALS, LINKS
from benchmarks.arm_speed_tables import print_arm_speed
from benchmarks.cases import Case, all_cases
from benchmarks.claims import below_reference, claims_of
from benchmarks.clear_table import clear_table
from benchmarks.comparison import SUITE as COMPARISON
from benchmarks.comparison import comparison_claims, comparison_table
from benchmarks.extremes import extremes_table
from benchmarks.figures import FIGURES, chosen, draw_all
from benchmarks.greedy_gap import greedy_table
from benchmarks.jacobians import jacobian_table
from benchmarks.linear_speed import HORIZONS
from benchmarks.method import Method, Settings
from benchmarks.methods import all_methods
from benchmarks.mpc.arm_loop import SOLVERS
from benchmarks.mpc.commands import print_endings, print_faults, print_loops
from benchmarks.mpc.dial import COMPARED, SCENARIOS
from benchmarks.pictures import bench_picture
from benchmarks.row import RESULTS, Row
from benchmarks.speed_tables import print_speed
from benchmarks.sweep import sweep, tasks_of
from benchmarks.table import table_of

BENCH_CASES = tuple(f"arm-{i:03d}-sum" for i in range(1, 7))
BENCH_METHODS = (
    "direct-75",
    "direct-150",
    "fatrop-75",
    "polish",
    "schuetz",
    "schuetz-sound",
    "shooting",
    "shooting-thesis",
    "indirect-15",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 if every claim that was checked holds."""
    options = _parser().parse_args(arguments)
    console = Console(width=None if sys.stdout.isatty() else 170)
    if options.command == "list":
        return _list(console)
    if options.command == "bench":
        return _bench(console, options.out, options.workers)
    if options.command == "figures":
        return _figures(console, options.numbers, options.out)
    if options.command == "speed":
        print_speed(console, options.horizons, options.count)
        return 0
    if options.command == "arm-speed":
        print_arm_speed(console, options.intervals, options.links, options.count)
        return 0
    if options.command == "mpc" and options.short:
        return print_endings(console)
    if options.command == "mpc":
        return print_loops(console, options.out, options.scenarios, options.controllers)
    if options.command == "faults":
        return print_faults(console, options.steps, options.seed)
    if options.command == "greedy":
        console.print(greedy_table())
        return 0
    if options.command == "clear":
        for kind in ("beyond", "radius"):
            console.print(clear_table(kind))
        return 0
    cases = _chosen(all_cases(), options.case, "case")
    if options.suite:
        cases = [case for case in cases if case.suite == options.suite]
    methods = _chosen(all_methods(), options.solver, "solver")
    settings = Settings(options.starts, options.seed)
    return _run(console, cases, methods, settings, options.out, options.workers, options.resume)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="suites, cases and solvers")
    run = commands.add_parser("run", help="run cases by solvers and print tables")
    run.add_argument("--suite", choices=sorted({case.suite for case in all_cases()}))
    run.add_argument(
        "--case", nargs="+", default=[], metavar="C", help="names, or their beginnings"
    )
    run.add_argument("--solver", nargs="+", default=[], metavar="N", help="names from `list`")
    run.add_argument("--starts", type=_positive, default=10, metavar="K", help="starts")
    run.add_argument("--seed", type=int, default=0)
    run.add_argument("--resume", action="store_true", help="keep the rows that are there")
    bench = commands.add_parser("bench", help="the main job: six scenarios, a table, a picture")
    for command in (run, bench):
        command.add_argument("--workers", type=_positive, default=2, metavar="W")
    figures = commands.add_parser("figures", help="figures of the thesis, with their data")
    known = ", ".join(figure.number for figure in FIGURES)
    figures.add_argument("numbers", nargs="*", metavar="NUMBER", help=f"of {known}; none: all")
    speed = commands.add_parser("speed", help="linear control: a step over N, and beside qpmpc")
    speed.add_argument("--horizons", nargs="+", type=_positive, default=HORIZONS, metavar="N")
    speed.add_argument("--count", type=_positive, default=20, metavar="K", help="steps measured")
    arm = commands.add_parser("arm-speed", help="MPC on the arm: a step interpreted, compiled")
    arm.add_argument("--intervals", nargs="*", type=_positive, default=INTERVALS, metavar="N")
    arm.add_argument("--links", nargs="*", type=_positive, default=LINKS, metavar="n")
    arm.add_argument("--count", type=_positive, default=40, metavar="K", help="steps measured")
    commands.add_parser("greedy", help="what it costs to look one step ahead only (1.4)")
    commands.add_parser("clear", help="which hard clearances no motion at all can keep (3.3)")
    faults = commands.add_parser("faults", help="closed loops in which everything fails")
    faults.add_argument("--steps", type=_positive, default=2000, metavar="K")
    faults.add_argument("--seed", type=int, default=0)
    loops = commands.add_parser("mpc", help="closed loops over the horizon, and other plants")
    loops.add_argument("--scenarios", nargs="*", default=SCENARIOS, metavar="S", help="arm-001 ...")
    loops.add_argument("--controllers", nargs="+", default=COMPARED, choices=tuple(SOLVERS))
    loops.add_argument("--short", action="store_true", help="terminal costs, delay, the mass")
    for command in (run, bench, figures, loops):
        command.add_argument("--out", type=Path, default=Path("results"), metavar="DIR")
    return parser


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{number} is not positive")
    return number


def _chosen(available: Sequence, names: Sequence[str], what: str) -> list:
    """Return what is called by name; a case also by the beginning of its name."""
    if not names:
        return list(available)
    chosen = []
    for name in names:
        exact = [entry for entry in available if entry.name == name]
        similar = [e for e in available if e.name.startswith(name)] if what == "case" else []
        if not exact and not similar:
            raise SystemExit(
                f"no {what} is called '{name}'; `python -m benchmarks list` names them"
            )
        chosen += [entry for entry in exact or similar if entry not in chosen]
    return chosen


def _list(console: Console) -> int:
    table = Table("suite", "cases", "of them with a reference")
    for suite in dict.fromkeys(case.suite for case in all_cases()):
        members = [case for case in all_cases() if case.suite == suite]
        known = sum(case.reference is not None for case in members)
        names = f"{members[0].name} ... {members[-1].name} ({len(members)})"
        table.add_row(suite, names, str(known))
    console.print(table)
    table = Table("solver", "suites", "runs on cases that declare", "what")
    for method in all_methods():
        table.add_row(method.name, " ".join(sorted(method.suites)), method.family, method.about)
    console.print(table)
    return 0


def _bench(console: Console, out: Path, workers: int) -> int:
    cases = _chosen(all_cases(), BENCH_CASES, "case")
    methods = _chosen(all_methods(), BENCH_METHODS, "solver")
    code = _run(console, cases, methods, Settings(starts=4), out, workers, resume=False)
    console.print(f"picture: {bench_picture(BENCH_CASES[0], out)}")
    return code


def _figures(console: Console, numbers: Sequence[str], out: Path) -> int:
    try:
        wanted = chosen(numbers)
    except KeyError as unknown:
        known = ", ".join(figure.number for figure in FIGURES)
        print(f"no figure has the number {unknown}; there are {known}", file=sys.stderr)
        return 2
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("figures", total=len(wanted))
        for figure, drawing in draw_all(wanted, out):
            bar.console.print(drawing.sentence, highlight=False, soft_wrap=True)
            bar.console.print(f"  {out / figure.stem}.png, .csv", highlight=False, soft_wrap=True)
            bar.advance(task)
    return 0


def _run(
    console: Console,
    cases: Sequence[Case],
    methods: Sequence[Method],
    settings: Settings,
    out: Path,
    workers: int,
    resume: bool,
) -> int:
    tasks = tasks_of(cases, methods, settings)
    if not tasks:
        console.print("no solver declares these cases: nothing to run")
        return 2
    rows = sweep(tasks, out, workers=workers, resume=resume)
    for suite in dict.fromkeys(row.suite for row in rows if row.suite != COMPARISON):
        for kind in ("sum", "closest") if suite == "arm" else ("",):
            here = [row for row in rows if row.suite == suite and row.case.endswith(kind)]
            if here:
                console.print(table_of(here, f"{suite} {kind}".strip()))
    compared = [comparison_table(rows, kind) for kind in ("closest", "sum")]
    for table in (*compared, extremes_table(rows), jacobian_table(rows)):
        if table is not None:
            console.print(table)
    console.print(f"rows: {out / RESULTS}")
    return _judge(console, rows)


def _judge(console: Console, rows: Sequence[Row]) -> int:
    """Print the claims; return 1 if one fails or a reference is disproved."""
    claims = (*claims_of(rows), *comparison_claims(rows))
    for claim in claims:
        console.print(f"{'holds' if claim.holds else 'FAILS'}: {claim.text} ({claim.evidence})")
    wrong = below_reference(rows)
    for row in wrong:
        console.print(
            f"FAILS: {row.solver} costs {row.gap:.1e} relative less than the reference of "
            f"{row.case}: the reference is wrong ({row.cost} < {row.reference})"
        )
    return int(bool(wrong) or not all(claim.holds for claim in claims))


if __name__ == "__main__":
    sys.exit(main())
