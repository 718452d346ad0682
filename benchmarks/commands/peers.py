"""``peers``: other packages on the same problems, each in its own environment."""

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.commands.command import Command
from benchmarks.commands.options import named, positive
from benchmarks.peers import (
    JOBS,
    PEERS,
    BadResults,
    Environment,
    InstallFailed,
    PeerReport,
    compare,
    markdown,
    quicker,
    tables,
)
from benchmarks.peers.race import COLD_SOLVES

_RESULTS = Path("results") / "peers.json"


def _options(parser: ArgumentParser) -> None:
    words = parser.add_subparsers(dest="word", required=True)
    words.add_parser("list", help="peers, whether they are installed, and the problems")
    install = words.add_parser("install", help="make the environment of peers")
    install.add_argument("names", nargs="+", metavar="NAME", help="from `peers list`; all: each")
    run = words.add_parser("run", help="run problems by our solvers and by peers")
    run.add_argument("--peer", nargs="+", default=[], metavar="NAME", help="default: all installed")
    run.add_argument("--problem", nargs="+", default=[], metavar="P", help="default: all")
    run.add_argument("--cold", type=positive, default=COLD_SOLVES, metavar="K", help="cold solves")
    run.add_argument("--out", type=Path, default=_RESULTS, metavar="FILE")
    show = words.add_parser("show", help="print the results of a run again, as Markdown")
    show.add_argument("file", type=Path, nargs="?", default=_RESULTS)


def _run(options: Namespace, console: Console) -> int:
    if options.word == "list":
        return _list(console)
    if options.word == "install":
        return _install(options.names, console)
    if options.word == "show":
        return _show(options.file)
    return _compare(options, console)


def _list(console: Console) -> int:
    table = Table("peer", "installed", "what")
    for peer in PEERS:
        table.add_row(peer.name, "yes" if Environment(peer).is_installed else "no", peer.about)
    console.print(table)
    problems = Table("problem", "what")
    for job in JOBS:
        problems.add_row(job.name, job.about)
    console.print(problems)
    return 0


def _install(names: list[str], console: Console) -> int:
    failed = False
    for peer in named(PEERS, [] if names == ["all"] else names, "peer"):
        try:
            Environment(peer).install()
            console.print(f"{peer.name}: installed")
        except InstallFailed as reason:
            failed = True
            print(reason, file=sys.stderr)
    return int(failed)


def _compare(options: Namespace, console: Console) -> int:
    """Return 0, 2 if a peer that was asked for by name is not installed, 1 if one failed."""
    jobs = named(JOBS, options.problem, "problem")
    wanted = named(PEERS, options.peer, "peer")
    missing = [peer for peer in wanted if not Environment(peer).is_installed]
    for peer in missing:
        print(
            f"{peer.name} is not installed: python -m benchmarks peers install {peer.name}",
            file=sys.stderr,
        )
    report = compare(
        [peer for peer in wanted if peer not in missing],
        jobs,
        cold=options.cold,
        said=lambda line: console.print(line, highlight=False),
    )
    report.write(options.out)
    for table in tables(report):
        console.print(table)
    for line in quicker(report):
        console.print(line, highlight=False, soft_wrap=True)
    console.print(f"rows: {options.out}")
    if options.peer and missing:
        return 2
    return int(any(entry.outcome == "failed" for entry in report.entries))


def _show(file: Path) -> int:
    try:
        print(markdown(PeerReport.read(file)))
    except BadResults as reason:
        print(reason, file=sys.stderr)
        return 2
    return 0


PEERS_COMMAND = Command("peers", "other packages on the same problems", _options, _run)
