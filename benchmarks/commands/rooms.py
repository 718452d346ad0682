"""``rooms``: the structure of the packages, from the import law."""

from argparse import ArgumentParser, Namespace

from rich.console import Console
from rich.table import Table

from benchmarks.commands.command import Command
from benchmarks.commands.options import add_out
from benchmarks.pictures.rooms import rooms, rooms_picture


def _options(parser: ArgumentParser) -> None:
    add_out(parser)


def _run(options: Namespace, console: Console) -> int:
    table = Table("package", "floor", "room", "files", "lines", "what it holds")
    for room in rooms():
        sizes = (str(room.floor), room.name, str(len(room.files)), str(room.lines))
        table.add_row(room.package, *sizes, room.about)
    console.print(table)
    console.print(rooms_picture(options.out))
    return 0


ROOMS = Command("rooms", "the rooms of the packages, from the import law", _options, _run)
