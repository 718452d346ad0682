"""``mpc``, ``faults`` and ``followed``: closed loops, with everything failing, and at random."""

from argparse import ArgumentParser, Namespace

from rich.console import Console

from benchmarks.cases import arm_cases
from benchmarks.commands.command import Command
from benchmarks.commands.options import add_out, positive, seconds
from benchmarks.mpc.arm_loop import SOLVERS
from benchmarks.mpc.commands import SHORT, print_faults, print_followed, print_loops
from benchmarks.mpc.dial import COMPARED, HORIZONS, SCENARIOS
from ocp import ProblemError


def _mpc_options(parser: ArgumentParser) -> None:
    arms = [c.name.removesuffix("-sum") for c in arm_cases() if c.name.endswith("-sum")]
    parser.add_argument(
        "--scenarios", nargs="+", default=(), choices=arms, metavar="S", help="arm-001 ..."
    )
    parser.add_argument("--controllers", nargs="+", default=COMPARED, choices=tuple(SOLVERS))
    parser.add_argument(
        "--horizons", nargs="+", default=(), type=seconds, metavar="T", help="in seconds"
    )
    parser.add_argument(
        "--short", nargs="*", choices=tuple(SHORT), help="these instead of the dial; none: all"
    )
    add_out(parser)


def _mpc(options: Namespace, console: Console) -> int:
    try:
        return _chosen(options, console)
    except ProblemError as error:  # a horizon that is shorter than the sampling interval
        console.print(str(error), markup=False)
        return 2


def _chosen(options: Namespace, console: Console) -> int:
    scenarios, horizons = options.scenarios, options.horizons
    if options.short is None:
        scenarios, horizons = scenarios or SCENARIOS, horizons or HORIZONS
        return print_loops(console, options.out, scenarios, options.controllers, horizons)
    for name in options.short or SHORT:
        SHORT[name](console, scenarios, horizons)
    return 0


def _faults_options(parser: ArgumentParser) -> None:
    parser.add_argument("--steps", type=positive, default=2000, metavar="K")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=positive, default=1, metavar="W", help="processes")


def _faults(options: Namespace, console: Console) -> int:
    return print_faults(console, options.steps, options.seed, options.workers)


def _followed_options(parser: ArgumentParser) -> None:
    parser.add_argument("--problems", type=positive, default=60, metavar="K")
    parser.add_argument("--seed", type=int, default=0)


def _followed(options: Namespace, console: Console) -> int:
    return print_followed(console, options.problems, options.seed)


MPC = Command("mpc", "closed loops over the horizon, and other plants", _mpc_options, _mpc)
FAULTS = Command("faults", "closed loops in which everything fails", _faults_options, _faults)
FOLLOWED = Command(
    "followed", "random loops: is every solved plan followed?", _followed_options, _followed
)
