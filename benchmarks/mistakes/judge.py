"""Does a diagnosis name the planted cause first, and is it silent where nothing is wrong?"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import perf_counter

from rich.table import Table

from benchmarks.mistakes.mistake import Mistake, Sound
from solvers import Diagnosis, diagnose

# The share of mistakes that has to be named first.
GOAL = 0.95


@dataclass(frozen=True)
class Judgement:
    """What came out for one problem.

    Attributes:
        entry: the mistake, or the sound problem.
        diagnosis: of its problem.
        seconds: it took [s].
    """

    entry: Mistake | Sound
    diagnosis: Diagnosis
    seconds: float

    @property
    def is_right(self) -> bool:
        """Whether the planted cause and its symbol come first; nothing serious in a sound one."""
        if isinstance(self.entry, Sound):
            return not self.diagnosis.serious
        first = self.diagnosis.first
        if first is None or first.cause is not self.entry.cause:
            return False
        return self.entry.symbol in first.where


def judged(entries: Sequence[Mistake | Sound]) -> Iterator[Judgement]:
    """Diagnose one problem after the other, each once."""
    for entry in entries:
        ocp, started = entry.build(), perf_counter()
        diagnosis = diagnose(ocp)
        yield Judgement(entry, diagnosis, perf_counter() - started)


def share(verdicts: Sequence[Judgement]) -> float:
    """Return how many are right, of 1."""
    return sum(v.is_right for v in verdicts) / max(len(verdicts), 1)


def verdict_table(verdicts: Sequence[Judgement]) -> Table:
    """Return one row for each problem: what was planted, what was found first."""
    table = Table(title="seeded mistakes and what diagnose says first")
    for column in ("problem", "planted", "symbol", "first", "named", "held out", "right", "s"):
        table.add_column(column, justify="right" if column == "s" else "left")
    for v in verdicts:
        first, entry = v.diagnosis.first, v.entry
        planted = ("-", "-") if isinstance(entry, Sound) else (entry.cause.name, entry.symbol)
        said = ("-", "-") if first is None else (_marked(v), ", ".join(first.where[:3]))
        marks = ("yes" if entry.held_out else "", "yes" if v.is_right else "NO")
        table.add_row(entry.name, *planted, *said, *marks, f"{v.seconds:.1f}")
    return table


def _marked(verdict: Judgement) -> str:
    first = verdict.diagnosis.first
    return "" if first is None else f"{first.cause.name} ({first.severity.name.lower()})"


def summary_table(verdicts: Sequence[Judgement]) -> Table:
    """Return the shares: all, tuned on, held out; mistakes and sound problems apart."""
    table = Table(title="named first; sound problems without a false alarm")
    for column in ("", "mistakes", "named first", "sound", "false alarms"):
        table.add_column(column, justify="right" if column else "left")
    groups = {
        "tuned on": [v for v in verdicts if not v.entry.held_out],
        "held out": [v for v in verdicts if v.entry.held_out],
        "all": list(verdicts),
    }
    for name, group in groups.items():
        wrong = [v for v in group if isinstance(v.entry, Mistake)]
        sound = [v for v in group if isinstance(v.entry, Sound)]
        alarms = sum(not v.is_right for v in sound)
        table.add_row(
            name,
            str(len(wrong)),
            f"{share(wrong):.0%}" if wrong else "-",
            str(len(sound)),
            str(alarms),
        )
    return table
