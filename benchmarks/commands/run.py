"""``run``: cases by solvers, in tables, with the claims that their rows can decide."""

from argparse import ArgumentParser, Namespace

from rich.console import Console

from benchmarks.cases import all_cases
from benchmarks.commands.command import Command
from benchmarks.commands.options import add_out, add_workers, named, positive, seconds
from benchmarks.commands.swept import print_sweep
from benchmarks.methods.every import all_methods
from benchmarks.methods.method import Settings
from benchmarks.sweep.executors import Execution


def _options(parser: ArgumentParser) -> None:
    suites = sorted({case.suite for case in all_cases()})
    parser.add_argument("--suite", nargs="+", choices=suites, default=[], metavar="S")
    parser.add_argument(
        "--case", nargs="+", default=[], metavar="C", help="names, or their beginnings"
    )
    parser.add_argument("--solver", nargs="+", default=[], metavar="N", help="names from `list`")
    parser.add_argument(
        "--starts", nargs="+", type=positive, default=[10], metavar="K", help="of the multi-start"
    )
    parser.add_argument("--seeds", nargs="+", type=int, default=[0], metavar="I")
    parser.add_argument("--resume", action="store_true", help="keep the rows that are there")
    parser.add_argument(
        "--retry", action="store_true", help="with --resume: not those that timed out or crashed"
    )
    _execution_options(parser)
    add_out(parser)


def _execution_options(parser: ArgumentParser) -> None:
    add_workers(parser)
    parser.add_argument(
        "--time-limit", type=seconds, default=600.0, metavar="SECONDS", help="for a row"
    )
    parser.add_argument("--executor", choices=("processes", "dask"), default="processes")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of Dask, as tcp://host:8786")


def _run(options: Namespace, console: Console) -> int:
    if (options.executor == "dask") != (options.scheduler is not None):
        console.print("--executor dask and --scheduler ADDRESS belong together")
        return 2
    cases = named(all_cases(), options.case, "case", by_beginning=True)
    if options.suite:
        cases = [case for case in cases if case.suite in options.suite]
    methods = named(all_methods(), options.solver, "solver")
    settings = [Settings(starts, seed) for starts in options.starts for seed in options.seeds]
    return print_sweep(
        console,
        cases,
        methods,
        settings,
        options.out,
        Execution(options.workers, options.scheduler, options.time_limit),
        resume=options.resume,
        retry=options.retry,
    )


RUN = Command("run", "run cases by solvers and print tables", _options, _run)
