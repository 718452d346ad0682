"""Options that several commands have, and names that a user types."""

import sys
from argparse import ArgumentParser, ArgumentTypeError
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import Protocol, TypeVar


class Named(Protocol):
    """What can be chosen by its name."""

    @property
    def name(self) -> str:
        """What a user types."""
        ...


T = TypeVar("T", bound=Named)


def positive(text: str) -> int:
    """Return a positive whole number.

    Raises:
        ArgumentTypeError: if it is not one; argparse says so.
    """
    number = int(text)
    if number < 1:
        raise ArgumentTypeError(f"{number} is not positive")
    return number


def seconds(text: str) -> float:
    """Return a positive, finite duration [s].

    Raises:
        ArgumentTypeError: if it is not one; argparse says so.
    """
    number = float(text)
    if not 0.0 < number < inf:
        raise ArgumentTypeError(f"{text} s is no duration")
    return number


def add_out(parser: ArgumentParser) -> None:
    """Declare the folder of the results."""
    parser.add_argument("--out", type=Path, default=Path("results"), metavar="DIR")


def add_workers(parser: ArgumentParser) -> None:
    """Declare the number of processes."""
    parser.add_argument("--workers", type=positive, default=2, metavar="W")


def named(
    available: Sequence[T], names: Sequence[str], what: str, *, by_beginning: bool = False
) -> list[T]:
    """Return what is called by name, everything where no name is given.

    Raises:
        SystemExit: with 2, as for any wrong argument, after a sentence; if there is no such name.
    """
    if not names:
        return list(available)
    chosen: list[T] = []
    for name in names:
        found = [entry for entry in available if entry.name == name]
        if not found and by_beginning:
            found = [entry for entry in available if entry.name.startswith(name)]
        if not found:
            said = f"no {what} is called '{name}'; `python -m benchmarks list` names them"
            print(said, file=sys.stderr)
            raise SystemExit(2)
        chosen += [entry for entry in found if entry not in chosen]
    return chosen
