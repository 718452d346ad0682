"""One result, one JSON object, one line."""

import json
import os
import platform
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from benchmarks.cases import Case
from benchmarks.method import Method, Outcome, Settings

RESULTS = "results.jsonl"
# A row counts as solved if its method says so and the referee finds no larger violation.
FEASIBLE = 1e-3
# An answer this close to the reference is the optimum, and not another extremal.
SAME_OPTIMUM = 5e-3

Key = tuple[str, str, str, str]


@dataclass(frozen=True, kw_only=True)
class Row:
    """A result as it is written; times in s, gap relative, None where a thing does not exist.

    ``cost``, ``violation``, ``stationarity`` and ``task_drift`` are the referee's; ``lower`` is the
    lower end of the reference.
    """

    suite: str
    case: str
    solver: str
    settings: str
    starts: int
    seed: int
    status: str
    message: str
    solved: bool
    optimum: bool | None
    cost: float | None
    reference: float | None
    lower: float | None
    gap: float | None
    local_gap: float | None
    violation: float | None
    worst: str
    stationarity: float | None
    task_drift: float | None
    residual: float
    iterations: int
    rollouts: int
    jacobians: int
    factorisations: int
    build_time: float
    solve_time: float
    versions: dict[str, str]
    machine: dict[str, str]

    @classmethod
    def of(cls, case: Case, method: Method, settings: Settings, outcome: Outcome) -> "Row":
        """Make the row of an outcome."""
        solution, verdict = outcome.solution, outcome.verdict
        gap = case.gap(verdict.cost)
        solved = solution.status.is_success and verdict.violation <= FEASIBLE
        return cls(
            suite=case.suite,
            case=case.name,
            solver=method.name,
            settings=method.settings,
            starts=settings.starts,
            seed=settings.seed,
            status=solution.status.name,
            message=solution.message,
            solved=solved,
            optimum=None if gap is None else solved and abs(gap) <= SAME_OPTIMUM,
            cost=_finite(verdict.cost),
            reference=case.reference.value if case.reference else None,
            lower=case.reference.lower if case.reference else None,
            gap=_finite(gap),
            local_gap=_finite(outcome.local_gap),
            violation=_finite(verdict.violation),
            worst=verdict.worst,
            stationarity=_finite(verdict.stationarity),
            task_drift=_finite(verdict.task_drift),
            residual=solution.residual,
            iterations=solution.iterations,
            rollouts=solution.work.rollouts,
            jacobians=solution.work.jacobians,
            factorisations=solution.work.factorisations,
            build_time=solution.build_time,
            solve_time=solution.solve_time,
            versions=versions(),
            machine=machine(),
        )

    @property
    def key(self) -> Key:
        """What makes a row the same row in another run."""
        return self.suite, self.case, self.solver, f"{self.settings} {self.starts} {self.seed}"

    def append_to(self, file: Path) -> None:
        """Write the row in one piece, so that a killed run cannot tear an older one."""
        line = json.dumps(asdict(self), allow_nan=False) + "\n"
        descriptor = os.open(file, os.O_APPEND | os.O_CREAT | os.O_WRONLY)
        try:
            os.write(descriptor, line.encode())
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def read_rows(file: Path) -> tuple[Row, ...]:
    """Return the rows of a file, the newest of each key; a torn last line is left out."""
    if not file.exists():
        return ()
    rows = {row.key: row for row in _parsed(file)}
    return tuple(rows.values())


def mend(file: Path) -> None:
    """End a torn last line, so that the next row starts on a line of its own."""
    if file.exists() and file.stat().st_size and not file.read_bytes().endswith(b"\n"):
        with file.open("ab") as end:
            end.write(b"\n")


def _parsed(file: Path) -> Iterator[Row]:
    for line in file.read_text(encoding="utf-8").splitlines():
        try:
            yield Row(**json.loads(line))
        except (json.JSONDecodeError, TypeError):  # torn, or of another version: computed again
            continue


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)


@cache
def versions() -> dict[str, str]:
    """Return the versions of what computes."""
    return {name: version(name) for name in ("ocp-toolkit", "casadi", "numpy", "scipy")}


@cache
def machine() -> dict[str, str]:
    """Return what the machine says of itself."""
    return {
        "system": platform.system(),
        "processor": platform.machine(),
        "cores": str(os.cpu_count()),
        "python": platform.python_version(),
    }
