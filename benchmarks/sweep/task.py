"""What a sweep computes: tasks by name, in groups that share a process."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby

from benchmarks.cases import Case
from benchmarks.methods.method import Method, Settings

Key = tuple[str, str, str, str]


@dataclass(frozen=True)
class SweepTask:
    """One row to compute, in words: what any process on any machine can be sent.

    Attributes:
        suite: of the case.
        case: its name.
        method: its name.
        options: of the method, as text.
        settings: what the sweep sets.
    """

    suite: str
    case: str
    method: str
    options: str
    settings: Settings

    @property
    def key(self) -> Key:
        """That of the row it becomes."""
        return key_of(self.suite, self.case, self.method, self.options, self.settings)


def key_of(suite: str, case: str, method: str, options: str, settings: Settings) -> Key:
    """Return what makes a row the same row in another run."""
    return suite, case, method, f"{options} {settings.starts} {settings.seed}"


def tasks_of(
    cases: Iterable[Case], methods: Sequence[Method], *settings: Settings
) -> tuple[SweepTask, ...]:
    """Return a task for every setting and method that a case declares, case by case."""
    return tuple(
        SweepTask(case.suite, case.name, method.name, method.settings, setting)
        for case in cases
        for setting in settings
        for method in methods
        if case.suite in method.suites and method.family in case.families
    )


def groups_of(tasks: Iterable[SweepTask]) -> list[tuple[SweepTask, ...]]:
    """Return the tasks of one case and setting together: several begin where another ended."""
    neighbours = groupby(tasks, key=lambda task: (task.suite, task.case, task.settings))
    return [tuple(group) for _, group in neighbours]
