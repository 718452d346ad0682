"""One result, one JSON object, one line."""

import os
import platform
import re
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import UnionType
from typing import get_type_hints

import numpy as np

from benchmarks.cases import Case
from benchmarks.methods.method import Method, Outcome, Settings
from benchmarks.sweep.json_line import check_types, entry_of, line_of
from benchmarks.sweep.task import Key, SweepTask, key_of
from ocp.internal import append_line

RESULTS = "results.jsonl"
# A row counts as solved if its method says so and the referee finds no larger violation.
FEASIBLE = 1e-3
# An answer this close to the reference is the optimum, and not another extremal.
SAME_OPTIMUM = 5e-3
# A row whose process did not live to return it; the message says how it ended.
TIMED_OUT, CRASHED = "TIMED_OUT", "CRASHED"
LOST = frozenset({TIMED_OUT, CRASHED})


@dataclass(frozen=True, kw_only=True)
class Row:
    """A result as it is written; times in s, gap relative, None where a thing does not exist.

    ``cost``, ``violation``, ``stationarity`` and ``task_drift`` are the referee's; ``lower`` is the
    lower end of the reference. ``states`` and ``controls`` are counts, ``intervals`` those of the
    answer's grid. Where ``status`` is one of ``LOST``, ``solve_time`` is how long the process had
    lived. ``when`` is UTC.
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
    residual: float | None
    iterations: int
    rollouts: int
    jacobians: int
    factorisations: int
    build_time: float
    solve_time: float
    states: int | None
    controls: int | None
    intervals: int | None
    when: str
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
            message=_text(solution.message),
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
            residual=_finite(solution.residual),
            iterations=solution.iterations,
            rollouts=solution.work.rollouts,
            jacobians=solution.work.jacobians,
            factorisations=solution.work.factorisations,
            build_time=solution.build_time,
            solve_time=solution.solve_time,
            states=solution.problem.model.nx,
            controls=solution.problem.model.nu,
            intervals=len(solution.t) - 1,
            when=_now(),
            versions=versions(),
            machine=machine(),
        )

    @classmethod
    def lost(cls, task: SweepTask, status: str, message: str, elapsed: float) -> "Row":
        """Make the row of a task whose process ended without an answer."""
        return cls(
            suite=task.suite,
            case=task.case,
            solver=task.method,
            settings=task.options,
            starts=task.settings.starts,
            seed=task.settings.seed,
            status=status,
            message=_text(message),
            solved=False,
            optimum=None,
            cost=None,
            reference=None,
            lower=None,
            gap=None,
            local_gap=None,
            violation=None,
            worst="",
            stationarity=None,
            task_drift=None,
            residual=None,
            iterations=0,
            rollouts=0,
            jacobians=0,
            factorisations=0,
            build_time=0.0,
            solve_time=elapsed,
            states=None,
            controls=None,
            intervals=None,
            when=_now(),
            versions=versions(),
            machine=machine(),
        )

    @classmethod
    def parse(cls, line: str) -> "Row":
        """Read a line.

        Raises:
            ValueError: if it is no row, saying why.
            OtherVersion: if it is one of another version of the format.
        """
        entry = entry_of(line)
        names = {field.name for field in fields(cls)}
        wrong = [f"no {name}" for name in sorted(names - entry.keys())]
        wrong += [f"an unknown {name}" for name in sorted(entry.keys() - names)]
        if wrong and isinstance(entry.get("versions"), dict):
            raise OtherVersion(f"it has {', '.join(wrong)}")
        if wrong:
            raise ValueError(f"it has {', '.join(wrong[:3])}{' ...' * (len(wrong) > 3)}")
        check_types(entry, _hints())
        return cls(**entry)

    def line(self) -> str:
        """Return the row as it is written."""
        return line_of(self)

    @property
    def key(self) -> Key:
        """What makes a row the same row in another run."""
        settings = Settings(self.starts, self.seed)
        return key_of(self.suite, self.case, self.solver, self.settings, settings)

    @property
    def setting(self) -> tuple[str, str, int, int]:
        """What rows of different methods have in common that can be compared."""
        return self.suite, self.case, self.starts, self.seed

    @property
    def is_lost(self) -> bool:
        """Whether its process did not live to return an answer."""
        return self.status in LOST

    def append_to(self, file: Path) -> None:
        """Write the row as a whole and bring it to the disk; an older one cannot be torn by it.

        Raises:
            OSError: if it cannot be written; the file is as it was.
        """
        append_line(file, self.line().encode())


class OtherVersion(ValueError):
    """A row that another version of the benchmarks has written."""


@cache
def _hints() -> dict[str, type | UnionType]:
    return get_type_hints(Row)


def _text(said: str) -> str:
    """Return what can be written: names of files may have bytes that are no text."""
    return said.encode(errors="replace").decode()


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


@cache
def versions() -> dict[str, str]:
    """Return the versions of what computes."""
    return {name: version(name) for name in ("ocp-toolkit", "casadi", "numpy", "scipy")}


@cache
def machine() -> dict[str, str]:
    """Return what the machine says of itself."""
    return {
        "system": platform.system(),
        "processor": f"{platform.machine()} {_processor()}".strip(),
        "cores": str(os.cpu_count()),
        "python": platform.python_version(),
    }


def _processor() -> str:
    """Return the name of the processor where Linux knows it."""
    listed = Path("/proc/cpuinfo")
    names = re.findall(r"model name\s*: (.*)", listed.read_text()) if listed.exists() else []
    return names[0] if names else ""
