"""``figures``: the figures of the thesis, with their data."""

import sys
from argparse import ArgumentParser, Namespace

from rich.console import Console
from rich.progress import Progress

from benchmarks.commands.command import Command
from benchmarks.commands.options import add_out
from benchmarks.figures import FIGURES, chosen, draw_all


def _known() -> str:
    return ", ".join(figure.number for figure in FIGURES)


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("numbers", nargs="*", metavar="NUMBER", help=f"of {_known()}; none: all")
    add_out(parser)


def _run(options: Namespace, console: Console) -> int:
    try:
        wanted = chosen(options.numbers)
    except KeyError as unknown:
        print(f"no figure has the number {unknown}; there are {_known()}", file=sys.stderr)
        return 2
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("figures", total=len(wanted))
        for figure, drawing in draw_all(wanted, options.out):
            files = f"  {options.out / figure.stem}.png, .csv{', .gif' if drawing.film else ''}"
            for line in (drawing.sentence, files):
                bar.console.print(line, highlight=False, soft_wrap=True)
            bar.advance(task)
    return 0


FIGURES_COMMAND = Command("figures", "figures of the thesis, with their data", _options, _run)
