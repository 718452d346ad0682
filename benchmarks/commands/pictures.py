"""``pictures``: the pictures of the page about them."""

from argparse import ArgumentParser, Namespace

from rich.console import Console

from benchmarks.commands.command import Command
from benchmarks.commands.options import add_out
from benchmarks.pictures.page import PAGE, draw_page


def _options(parser: ArgumentParser) -> None:
    add_out(parser)


def _run(options: Namespace, console: Console) -> int:
    for file in draw_page(PAGE, options.out):
        console.print(str(file), highlight=False, soft_wrap=True)
    return 0


PICTURES = Command("pictures", "the pictures of docs/pictures.md", _options, _run)
