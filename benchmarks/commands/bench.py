"""``bench``: the main job, six scenarios of the arm by nine methods."""

from argparse import ArgumentParser, Namespace

from rich.console import Console

from benchmarks.cases import all_cases
from benchmarks.commands.command import Command
from benchmarks.commands.options import add_out, add_workers, named
from benchmarks.commands.swept import print_sweep
from benchmarks.methods.every import all_methods
from benchmarks.methods.method import Settings
from benchmarks.pictures.main_job import bench_picture
from benchmarks.sweep.executors import Execution

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


def _options(parser: ArgumentParser) -> None:
    add_workers(parser)
    add_out(parser)


def _run(options: Namespace, console: Console) -> int:
    cases = named(all_cases(), BENCH_CASES, "case")
    methods = named(all_methods(), BENCH_METHODS, "solver")
    code = print_sweep(
        console,
        cases,
        methods,
        [Settings(starts=4)],
        options.out,
        Execution(options.workers),
        resume=False,
    )
    console.print(f"picture: {bench_picture(BENCH_CASES[0], options.out)}")
    return code


BENCH = Command("bench", "the main job: six scenarios, a table, a picture", _options, _run)
