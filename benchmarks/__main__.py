"""Command line: ``python -m benchmarks``; with ``--help`` it says what it can do."""

import sys
from argparse import ArgumentParser
from collections.abc import Sequence

from rich.console import Console

from benchmarks.commands import COMMANDS


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 if every claim that was checked holds."""
    options = _parser().parse_args(arguments)
    console = Console(width=None if sys.stdout.isatty() else 170)
    return options.run(options, console)


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="python -m benchmarks", description=__doc__)
    words = parser.add_subparsers(dest="command", required=True)
    for command in COMMANDS:
        options = words.add_parser(command.name, help=command.about)
        options.set_defaults(run=command.run)
        command.add_options(options)
    return parser


if __name__ == "__main__":
    sys.exit(main())
