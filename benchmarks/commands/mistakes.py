"""``mistakes``: a corpus of seeded mistakes, and how often they are named first."""

from argparse import ArgumentParser, Namespace

from rich.console import Console

from benchmarks.commands.command import Command
from benchmarks.mistakes import MISTAKES, SOUND, Mistake
from benchmarks.mistakes.judge import GOAL, judged, share, summary_table, verdict_table


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--say", action="store_true", help="print every diagnosis in full")
    parser.add_argument("--only", default="", metavar="TEXT", help="problems whose name has TEXT")


def _run(options: Namespace, console: Console) -> int:
    entries = [entry for entry in (*MISTAKES, *SOUND) if options.only in entry.name]
    if not entries:
        console.print(f"no problem of the corpus has '{options.only}' in its name")
        return 2
    verdicts = list(judged(entries))
    if options.say:
        for verdict in verdicts:
            console.print(
                f"[{verdict.entry.name}] {verdict.diagnosis}", markup=False, soft_wrap=True
            )
    console.print(verdict_table(verdicts))
    console.print(summary_table(verdicts))
    wrong = [v for v in verdicts if isinstance(v.entry, Mistake)]
    holds = share(wrong) >= GOAL or not wrong
    console.print(
        f"{'holds' if holds else 'FAILS'}: diagnose names the planted cause first in at least "
        f"{GOAL:.0%} of the mistakes ({share(wrong):.1%})"
    )
    return int(not holds)


MISTAKES_COMMAND = Command(
    "mistakes", "seeded mistakes: is the planted cause named first?", _options, _run
)
