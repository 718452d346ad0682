"""What a command of ``python -m benchmarks`` is."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import dataclass

from rich.console import Console


@dataclass(frozen=True)
class Command:
    """One word after ``python -m benchmarks``.

    Attributes:
        name: the word.
        about: one line for ``--help``.
        add_options: declares its options.
        run: (options, console) -> exit code; 0: everything that was asked holds.
    """

    name: str
    about: str
    add_options: Callable[[ArgumentParser], None]
    run: Callable[[Namespace, Console], int]


def no_options(parser: ArgumentParser) -> None:
    """Declare nothing."""
