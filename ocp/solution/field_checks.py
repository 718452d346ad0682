"""Checks of the fields of a solution: their kinds and shapes, and that no number is NaN."""

from math import isfinite
from typing import Protocol

import numpy as np

from ocp.checks.arguments import check_instance
from ocp.checks.errors import ProblemError
from ocp.problem.ocp import OCP
from ocp.solution.solution_file import ARRAYS
from ocp.solution.status import Status


class _Fields(Protocol):
    """What of a ``Solution`` is not read by its name alone: its own file is built on this one."""

    @property
    def problem(self) -> OCP: ...

    @property
    def status(self) -> Status: ...

    @property
    def t(self) -> np.ndarray: ...

    @property
    def u(self) -> np.ndarray: ...

    @property
    def control_kind(self) -> str: ...

    @property
    def breaks(self) -> np.ndarray: ...


def check_fields(solution: _Fields) -> None:
    """Check the fields of a solution.

    Raises:
        ProblemError: naming the field that is wrong.
    """
    check_instance(solution.problem, OCP, "solution: problem")
    check_instance(solution.status, Status, "solution: status")
    for name in ARRAYS:
        if not isinstance(array := getattr(solution, name), np.ndarray):
            check_instance(array, np.ndarray, f"solution: {name}")
    _check_arrays(solution)
    for name in ("cost", "residual"):
        value = getattr(solution, name)
        if not isinstance(value, float):
            check_instance(value, (float, int, np.floating, np.integer), f"solution: {name}")
        if value != value:
            raise ProblemError(f"solution: {name} is NaN")


def _check_arrays(solution: _Fields) -> None:
    """Check shapes, that numbers are finite, and that time increases."""
    n, m = len(solution.t), solution.problem.model
    for name, shape in (
        ("t", (n,)),
        ("x", (n, m.nx)),
        ("x0", (m.nx,)),
        ("costate", (n, m.nx)),
        ("u", (_control_rows(solution), m.nu)),
    ):
        array = getattr(solution, name)
        if array.shape != shape:
            raise ProblemError(f"solution: {name} has shape {array.shape}, {shape} is needed")
        if not _is_finite(array):
            raise ProblemError(f"solution: {name} is not finite")
    if n < 2 or np.count_nonzero(solution.t[1:] > solution.t[:-1]) < n - 1:
        raise ProblemError("solution: t does not increase from node to node")


def _control_rows(solution: _Fields) -> int:
    """Return how many rows u must have; of coefficients as many as there are, if that fits."""
    last, breaks = len(solution.t) - 1, solution.breaks
    if solution.control_kind != "polynomial":
        return last if solution.control_kind == "held" else last + 1
    increasing = breaks.ndim == 1 and len(breaks) > 1 and (np.diff(breaks) > 0).all()
    if not increasing or breaks[0] != 0 or breaks[-1] != last:
        raise ProblemError(f"solution: breaks = {breaks}, they must increase from 0 to {last}")
    pieces = len(breaks) - 1
    return max(1, len(solution.u) // pieces) * pieces


def _is_finite(array: np.ndarray) -> bool:
    """Whether every number is finite; so it is where the sum of squares is, one quick operation."""
    return isfinite(np.vdot(array, array)) or bool(np.isfinite(array).all())
