"""What a file keeps of a solution, and what is read of it again."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol, Self

import numpy as np

from ocp.checks.errors import ProblemError
from ocp.files.archive import made_of, read_archive
from ocp.normal_form.normal_form import normal_form
from ocp.problem.fingerprint import differing_in
from ocp.problem.ocp import OCP
from ocp.solution.status import Status
from ocp.solution.work import Work

#: The fields that are arrays of any solution.
ARRAYS = ("t", "x", "x0", "costate", "u")
_SCALARS = {
    "solver": str,
    "message": str,
    "control_kind": str,
    "cost": float,
    "residual": float,
    "iterations": int,
    "build_time": float,
    "solve_time": float,
}
# Fields that are values by name.
_GROUPS = ("history", "parameters", "unknowns")


class _Kept(Protocol):
    """What of a ``Solution`` is not read by its name alone: its own file is built on this one."""

    @property
    def problem(self) -> OCP: ...

    @property
    def status(self) -> Status: ...

    @property
    def work(self) -> Work: ...

    @property
    def normal(self) -> Self | None: ...


def content_of(solution: _Kept) -> dict[str, Any]:
    """Return what an archive keeps."""
    content = {name: getattr(solution, name) for name in (*ARRAYS, "breaks", *_SCALARS)}
    content |= {
        f"{group}/{key}": value
        for group in _GROUPS
        for key, value in getattr(solution, group).items()
    }
    content |= {f"work/{name}": count for name, count in asdict(solution.work).items()}
    content |= {"status": solution.status.name, "problem": solution.problem.name}
    if solution.normal is not None:
        content |= {f"normal/{k}": value for k, value in content_of(solution.normal).items()}
    return content


def read_fields(path: str | Path, problem: OCP) -> dict[str, Any]:
    """Return the fields of a solution of a problem from a file; those of its normal form in it.

    Raises:
        ProblemError: if the file cannot be read, or belongs to another problem.
        DamagedFile: if it is no solution, or not as it was saved.
    """
    needed = {"status", "problem", *ARRAYS, *_SCALARS}
    data = read_archive(path, "solution", needed)
    data.setdefault("breaks", np.empty(0, dtype=int))  # files of before there were any
    if str(data["problem"]) != problem.name:
        raise ProblemError(f"{path} solves '{data['problem']}', not '{problem.name}'")
    with made_of(path, "solution"):
        other = differing_in(data, problem)
    if other:
        raise ProblemError(f"{path} solves another '{problem.name}': {', '.join(other)} differ")
    with made_of(path, "solution"):
        return _fields(data, problem)


def _fields(data: Mapping[str, np.ndarray], problem: OCP) -> dict[str, Any]:
    names = (*_GROUPS, "work", "probe", "normal")
    groups: dict[str, dict[str, np.ndarray]] = {name: {} for name in names}
    for name, value in data.items():
        group, _, key = name.partition("/")
        if key:
            groups[group][key] = value
    if str(data["status"]) not in Status.__members__:
        raise ProblemError(f"its status is '{data['status']}'")
    form = normal_form(problem) if groups["normal"] else None
    return {
        "problem": problem,
        "status": Status[str(data["status"])],
        **{name: data[name] for name in (*ARRAYS, "breaks")},
        **{name: kind(data[name][()]) for name, kind in _SCALARS.items()},
        **{name: groups[name] for name in _GROUPS},
        "normal": None if form is None else _fields(groups["normal"], form.problem),
        "work": Work(**{k: int(v) for k, v in groups["work"].items()}),
    }
