"""``run``: cases by solvers, in tables, with the claims that their rows can decide."""

from argparse import ArgumentParser, Namespace

from rich.console import Console

from benchmarks.cases import all_cases
from benchmarks.commands.command import Command
from benchmarks.commands.options import add_out, add_workers, named, positive
from benchmarks.commands.swept import print_sweep
from benchmarks.method import Settings
from benchmarks.methods import all_methods


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--suite", choices=sorted({case.suite for case in all_cases()}))
    parser.add_argument(
        "--case", nargs="+", default=[], metavar="C", help="names, or their beginnings"
    )
    parser.add_argument("--solver", nargs="+", default=[], metavar="N", help="names from `list`")
    parser.add_argument("--starts", type=positive, default=10, metavar="K", help="starts")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--resume", action="store_true", help="keep the rows that are there")
    add_workers(parser)
    add_out(parser)


def _run(options: Namespace, console: Console) -> int:
    cases = named(all_cases(), options.case, "case", by_beginning=True)
    if options.suite:
        cases = [case for case in cases if case.suite == options.suite]
    methods = named(all_methods(), options.solver, "solver")
    settings = Settings(options.starts, options.seed)
    return print_sweep(
        console, cases, methods, settings, options.out, options.workers, options.resume
    )


RUN = Command("run", "run cases by solvers and print tables", _options, _run)
