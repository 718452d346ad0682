"""The commands of ``python -m benchmarks``, in the order of its help."""

from benchmarks.commands.answers import CLEAR, GREEDY
from benchmarks.commands.bench import BENCH
from benchmarks.commands.certify import CERTIFY
from benchmarks.commands.command import Command
from benchmarks.commands.figures import FIGURES_COMMAND
from benchmarks.commands.listing import LIST
from benchmarks.commands.loops import FAULTS, FOLLOWED, MPC
from benchmarks.commands.mistakes import MISTAKES_COMMAND
from benchmarks.commands.pages import PAGES
from benchmarks.commands.peers import PEERS_COMMAND
from benchmarks.commands.report import REPORT
from benchmarks.commands.rooms import ROOMS
from benchmarks.commands.run import RUN
from benchmarks.commands.speed import (
    ARM_SPEED,
    BATCH_SPEED,
    NATIVE_SPEED,
    PHASES_SPEED,
    SPEED,
)

COMMANDS: tuple[Command, ...] = (
    LIST,
    RUN,
    REPORT,
    BENCH,
    CERTIFY,
    FIGURES_COMMAND,
    SPEED,
    ARM_SPEED,
    PHASES_SPEED,
    NATIVE_SPEED,
    BATCH_SPEED,
    GREEDY,
    CLEAR,
    MPC,
    FAULTS,
    FOLLOWED,
    MISTAKES_COMMAND,
    PEERS_COMMAND,
    PAGES,
    ROOMS,
)

__all__ = ["COMMANDS", "Command"]
