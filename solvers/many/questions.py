"""``Questions``: the data of many runs of one problem, checked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, InitialGuess, ProblemError
from ocp.internal import ParameterValues, RunData, check_instance, check_numeric, check_real


@dataclass(frozen=True, eq=False)
class Questions:
    """What is asked of each of K runs.

    Attributes:
        ocp: the problem.
        count: K.
        t0: initial time of all [s].
        starts: (K, nx).
        parameters: by name, with K rows each.
        guesses: K of them, or one for all; an entry that is None is the problem's own.
    """

    ocp: OCP
    count: int
    t0: float
    starts: np.ndarray
    parameters: Mapping[str, Sequence[Any]]
    guesses: tuple[InitialGuess | None, ...]

    @classmethod
    def of(
        cls,
        ocp: OCP,
        x0: ArrayLike | None,
        t0: float,
        parameters: Mapping[str, ArrayLike] | None,
        guesses: Sequence[InitialGuess | None] | InitialGuess | None,
    ) -> "Questions":
        """Check what is asked, see ``solve_many``.

        Raises:
            ProblemError: saying what does not fit, and of which run.
        """
        check_real(t0, "solve_many: t0")
        starts = None if x0 is None else _starts(ocp, x0)
        values = _values(ocp, parameters)
        each = tuple(guesses) if isinstance(guesses, tuple | list) else None
        lengths = {name: len(rows) for name, rows in values.items()}
        lengths |= {} if starts is None else {"x0": len(starts)}
        lengths |= {} if each is None else {"guesses": len(each)}
        count = _common(lengths)
        x = np.tile(ocp.start(), (count, 1)) if starts is None else starts
        first = (guesses,) if each is None else each
        found = cls(ocp, count, float(t0), x, values, tuple(map(ocp.first_guess, first)))
        _ = found._numbers  # looks at them
        return found

    @cached_property
    def _numbers(self) -> list[ParameterValues]:
        """The parameters of every run, whose shapes only the problem knows."""
        if not self.parameters:
            return [self.ocp.parameter_values()] * self.count
        found = []
        for i in range(self.count):
            try:
                found.append(self.ocp.parameter_values(self.values(i)))
            except ProblemError as error:
                raise ProblemError(f"solve_many: run {i}: {error}") from None
        return found

    def values(self, i: int) -> dict[str, Any] | None:
        """Return the parameters of run i."""
        return {name: rows[i] for name, rows in self.parameters.items()} or None

    def guess(self, i: int) -> InitialGuess | None:
        """Return the guess of run i."""
        return self.guesses[i if len(self.guesses) > 1 else 0]

    def data(self, i: int) -> RunData:
        """Return the numbers of run i."""
        return RunData(self.starts[i], self.t0, self._numbers[i])


def _starts(ocp: OCP, x0: ArrayLike) -> np.ndarray:
    """Return starts as (K, nx)."""
    starts, nx = check_numeric(x0, "solve_many: x0"), ocp.model.nx
    if starts.ndim != 2 or starts.shape[1] != nx or not len(starts):
        raise ProblemError(
            f"solve_many: x0 has shape {starts.shape}, (K, {nx}) is needed, a start in each row"
        )
    wrong = np.flatnonzero(~np.isfinite(starts).all(axis=1))
    if wrong.size:
        raise ProblemError(f"solve_many: x0 of run {wrong[0]} is not finite: {starts[wrong[0]]}")
    return starts


def _values(ocp: OCP, parameters: Mapping[str, ArrayLike] | None) -> dict[str, Sequence[Any]]:
    """Return parameters by name with a row for each run; what a row is the problem checks."""
    if parameters is None:
        return {}
    check_instance(parameters, Mapping, "solve_many: parameters")
    found: dict[str, Sequence[Any]] = {}
    for name, rows in parameters.items():
        is_flat = isinstance(rows, np.ndarray) and rows.ndim == 0
        if is_flat or not isinstance(rows, list | tuple | np.ndarray):
            raise ProblemError(
                f"solve_many: parameter '{name}' is {rows!r}, an array with a row for each run is "
                "needed"
            )
        found[name] = list(rows)
    return found


def _common(lengths: Mapping[str, int]) -> int:
    """Return how many runs there are."""
    if not lengths:
        raise ProblemError(
            "solve_many: nothing differs from run to run: give x0, parameters or a list of guesses"
        )
    if len(set(lengths.values())) > 1 or not all(lengths.values()):
        said = ", ".join(f"{count} of {name}" for name, count in lengths.items())
        raise ProblemError(f"solve_many: there are {said}; each needs one for every run")
    return next(iter(lengths.values()))
