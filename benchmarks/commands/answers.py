"""``greedy`` and ``clear``: two questions of the thesis, answered with a table."""

from argparse import Namespace

from rich.console import Console

from benchmarks.commands.command import Command, no_options
from benchmarks.questions.clear_table import clear_table
from benchmarks.questions.greedy_gap import greedy_table


def _greedy(options: Namespace, console: Console) -> int:
    console.print(greedy_table())
    return 0


def _clear(options: Namespace, console: Console) -> int:
    for kind in ("beyond", "radius"):
        console.print(clear_table(kind))
    return 0


GREEDY = Command("greedy", "what it costs to look one step ahead only (1.4)", no_options, _greedy)
CLEAR = Command(
    "clear", "which hard clearances no motion at all can keep (3.3)", no_options, _clear
)
