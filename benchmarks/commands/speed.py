"""``speed`` and ``arm-``, ``phases-``, ``native-``, ``batch-speed``: what steps and solves cost."""

from argparse import ArgumentParser, Namespace

from rich.console import Console

from benchmarks.commands.command import Command
from benchmarks.commands.options import positive
from benchmarks.speed.arm import INTERVALS, LINKS
from benchmarks.speed.arm_tables import print_arm_speed
from benchmarks.speed.batch import batch_table, batches
from benchmarks.speed.linear import HORIZONS
from benchmarks.speed.linear_tables import print_speed
from benchmarks.speed.native import layers, layers_table, measured, native_table, races
from benchmarks.speed.phases_tables import print_phases_speed


def _linear_options(parser: ArgumentParser) -> None:
    parser.add_argument("--horizons", nargs="+", type=positive, default=HORIZONS, metavar="N")
    parser.add_argument("--count", type=positive, default=20, metavar="K", help="steps measured")


def _linear(options: Namespace, console: Console) -> int:
    print_speed(console, options.horizons, options.count)
    return 0


def _arm_options(parser: ArgumentParser) -> None:
    parser.add_argument("--intervals", nargs="*", type=positive, default=INTERVALS, metavar="N")
    parser.add_argument("--links", nargs="*", type=positive, default=LINKS, metavar="n")
    parser.add_argument("--count", type=positive, default=40, metavar="K", help="steps measured")
    parser.add_argument("--only-driver", action="store_true", help="time around the solver only")


def _arm(options: Namespace, console: Console) -> int:
    print_arm_speed(
        console,
        options.intervals,
        options.links,
        options.count,
        only_driver=options.only_driver,
    )
    return 0


def _phases_options(parser: ArgumentParser) -> None:
    parser.add_argument("--count", type=positive, default=5, metavar="K", help="runs measured")


def _phases(options: Namespace, console: Console) -> int:
    print_phases_speed(console, options.count)
    return 0


def _native_options(parser: ArgumentParser) -> None:
    parser.add_argument("--count", type=positive, default=40, metavar="K", help="solves measured")
    parser.add_argument(
        "--steps", type=positive, default=10_000, metavar="K", help="control steps measured"
    )


def _native(options: Namespace, console: Console) -> int:
    for race in races():
        console.print(native_table(race, measured(race, options.count)))
        if race.is_warm:
            console.print(layers_table(race, layers(race, options.steps)))
    return 0


def _batch_options(parser: ArgumentParser) -> None:
    parser.add_argument("--count", type=positive, default=1024, metavar="K", help="starts")


def _batch(options: Namespace, console: Console) -> int:
    console.print(batch_table(list(batches(options.count))))
    return 0


SPEED = Command("speed", "linear control: a step over N", _linear_options, _linear)
ARM_SPEED = Command("arm-speed", "MPC on the arm: a step interpreted, compiled", _arm_options, _arm)
PHASES_SPEED = Command(
    "phases-speed", "phases beside a chain written by hand", _phases_options, _phases
)
NATIVE_SPEED = Command(
    "native-speed", "the native backend: one solve beside others", _native_options, _native
)
BATCH_SPEED = Command(
    "batch-speed", "many starts at once, beside one by one", _batch_options, _batch
)
