"""What is known only at run time: constant parameters and sampled signals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_instance, check_numbers, check_numeric
from ocp.checks.errors import ProblemError
from ocp.checks.expressions import check_symbols
from ocp.problem.constraint import Box
from ocp.problem.portable import Portable

# Two grids whose nodes differ by rounding must be taken as the same grid.
_SAME_NODE = 1e-9


class _Constant(Portable):
    """What has one value along a run."""

    name: str
    symbol: ca.SX
    kind: ClassVar[str]

    @property
    def knots(self) -> np.ndarray:
        """Instants in [0, 1] between which the value is smooth."""
        return np.array([0.0, 1.0])

    def checked(self, value: ArrayLike) -> np.ndarray:
        """Return ``value`` as (m,), or raise ``ProblemError``."""
        return check_numbers(value, self.symbol.numel(), f"{self.kind} '{self.name}'")

    def at(self, value: np.ndarray, fraction: np.ndarray, side: Literal[-1, 1]) -> np.ndarray:
        """Return the value at each fraction of the horizon, (len(fraction), m)."""
        return np.tile(value, (len(fraction), 1))


@dataclass(frozen=True, eq=False)
class Parameter(_Constant):
    """A constant of the problem whose value may change from run to run.

    Args:
        name: the key under which ``run(parameters=...)`` takes another value.
        symbol: ``SX`` column (m,).
        value: the value (m,) unless a run says otherwise.
    """

    name: str
    symbol: ca.SX
    value: ArrayLike
    kind: ClassVar[str] = "parameter"

    def __post_init__(self) -> None:
        """Check symbol and value."""
        symbol = check_symbols(self.symbol, f"parameter '{self.name}'")
        object.__setattr__(self, "symbol", symbol)
        object.__setattr__(self, "value", self.checked(self.value))


@dataclass(frozen=True, eq=False)
class Unknown(_Constant):
    """A constant that the optimiser chooses, as a control that never changes.

    What others call a static parameter, a design variable or a decision variable: the mass of a
    ship that is to be built, a rate constant that is to be estimated.

    Args:
        name: the key under which solutions and guesses have its value.
        symbol: ``SX`` column (m,), in dynamics, costs and constraints.
        guess: first guess (m,).
        lower: least value, a number or (m,).
        upper: largest value, a number or (m,).

    Raises:
        ProblemError: if symbol, guess or bounds do not fit together.
    """

    name: str
    symbol: ca.SX
    guess: ArrayLike
    lower: ArrayLike = -np.inf
    upper: ArrayLike = np.inf
    kind: ClassVar[str] = "unknown constant"

    def __post_init__(self) -> None:
        """Check symbol, guess and bounds."""
        check_instance(self.name, str, "the name of an unknown constant")
        what = f"{self.kind} '{self.name}'"
        object.__setattr__(self, "symbol", check_symbols(self.symbol, what))
        guess, box = self.checked(self.guess), Box(self.lower, self.upper)
        box = box.sized(self.symbol.numel(), what)
        if box.excess(guess).any():
            raise ProblemError(
                f"{what}: its guess {guess} is outside its bounds, {box.lower} to {box.upper}"
            )
        for name, value in (("guess", guess), ("lower", box.lower), ("upper", box.upper)):
            object.__setattr__(self, name, value)

    @property
    def value(self) -> np.ndarray:
        """The guess (m,)."""
        return np.asarray(self.guess)

    @property
    def size(self) -> np.ndarray:
        """Typical sizes (m,): of its guess, or of its bounds."""
        known = np.abs([self.value, np.asarray(self.lower), np.asarray(self.upper)])
        guess, bounds = known[0], np.where(np.isfinite(known[1:]), known[1:], 0.0).max(axis=0)
        size = np.where(guess > 0.0, guess, bounds)
        return np.where(size > 0.0, size, 1.0)

    @property
    def box(self) -> Box:
        """Its bounds, each (m,)."""
        return Box(self.lower, self.upper)


@dataclass(frozen=True, eq=False)
class StartValue(_Constant):
    """The state at the start of a run, as a constant of it: ``Model.start``.

    Args:
        symbol: ``SX`` column (nx,).
        value: where the start is declared to be (nx,).
    """

    symbol: ca.SX
    value: np.ndarray
    name: str = "x(t0)"
    kind: ClassVar[str] = "start value"


@dataclass(frozen=True, eq=False)
class PastInput(_Constant):
    """What was sent before the start of a run: the last input, or the history of a control.

    Args:
        symbol: ``SX`` column (m,).
        value: as declared (m,).
        name: the key under which a run takes another one.
    """

    symbol: ca.SX
    value: np.ndarray
    name: str
    kind: ClassVar[str] = "past input"


@dataclass(frozen=True, eq=False)
class Signal(Portable):
    """A reference sampled over the horizon, at N + 1 equally spaced instants.

    Args:
        name: the key under which ``run(parameters=...)`` takes other samples.
        symbol: ``SX`` column (m,).
        samples: (N + 1, m), first at t0, last at the final time.
        hold: ``"held"``: constant from one sample to the next; ``"linear"``: interpolated.
    """

    name: str
    symbol: ca.SX
    samples: ArrayLike
    hold: Literal["held", "linear"] = "held"

    def __post_init__(self) -> None:
        """Check symbol and samples."""
        symbol = check_symbols(self.symbol, f"signal '{self.name}'")
        object.__setattr__(self, "symbol", symbol)
        if self.hold not in ("held", "linear"):
            raise ProblemError(
                f"signal '{self.name}': hold = {self.hold!r} is neither held nor linear"
            )
        object.__setattr__(self, "samples", self.checked(self.samples))

    def __repr__(self) -> str:
        """Return one line: how many samples, and what is between them."""
        return f"<Signal '{self.name}': samples {self.value.shape}, {self.hold}>"

    @property
    def value(self) -> np.ndarray:
        """The samples, (N + 1, m)."""
        return np.asarray(self.samples)

    @property
    def knots(self) -> np.ndarray:
        """Instants in [0, 1] between which the signal is smooth."""
        return np.linspace(0.0, 1.0, len(self.value))

    def checked(self, samples: ArrayLike) -> np.ndarray:
        """Return ``samples`` as (N + 1, m), or raise ``ProblemError``."""
        values = check_numeric(samples, f"signal '{self.name}'")
        values = values[:, None] if values.ndim == 1 else values
        width = self.symbol.numel()
        if values.ndim != 2 or values.shape[1] != width or len(values) < 2:
            raise ProblemError(
                f"signal '{self.name}': samples have shape {values.shape}, "
                f"(N + 1, {width}) is needed"
            )
        if not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
            raise ProblemError(f"signal '{self.name}': sample {row} is not finite: {values[row]}")
        values.flags.writeable = False
        return values

    def at(self, samples: np.ndarray, fraction: np.ndarray, side: Literal[-1, 1]) -> np.ndarray:
        """Return the signal at each fraction of the horizon, (len(fraction), m).

        ``side`` says which one-sided limit is meant where a held signal jumps.
        """
        last = len(samples) - 1
        position = np.asarray(fraction) * last
        if self.hold == "linear":
            columns = [np.interp(position, np.arange(last + 1), c) for c in samples.T]
            return np.stack(columns, axis=1)
        if side > 0:
            index = np.floor(position + _SAME_NODE).astype(int)
        else:
            index = np.ceil(position - _SAME_NODE).astype(int) - 1
        return samples[np.clip(index, 0, last)]


@dataclass(frozen=True, eq=False)
class Steps(Portable):
    """A constant that has another value behind each of some instants; no run changes it.

    Args:
        name: of it.
        symbol: ``SX`` column (m,).
        inner: the instants, as fractions of the horizon inside it, (K,).
        value: before the first, behind each, (K + 1, m).
    """

    name: str
    symbol: ca.SX
    inner: np.ndarray
    value: np.ndarray

    def __post_init__(self) -> None:
        """Check that there is a value for each part of the horizon."""
        if len(self.value) != len(self.inner) + 1:
            raise ProblemError(
                f"steps '{self.name}': {len(self.value)} values, {len(self.inner) + 1} are needed"
            )

    @property
    def knots(self) -> np.ndarray:
        """Instants in [0, 1] between which it is constant."""
        return np.array([0.0, *self.inner, 1.0])

    def checked(self, value: ArrayLike) -> np.ndarray:
        """Return the values as an array."""
        return np.asarray(value)

    def at(self, value: np.ndarray, fraction: np.ndarray, side: Literal[-1, 1]) -> np.ndarray:
        """Return the value at each fraction of the horizon, (len(fraction), m)."""
        return value[np.searchsorted(self.inner, np.asarray(fraction) + side * _SAME_NODE)]


# What stands in the vector p of a problem.
Entry = Parameter | Signal | Steps | PastInput | Unknown | StartValue


@dataclass(frozen=True)
class ParameterValues:
    """The numbers of one run, ready to be sampled on any grid.

    Attributes:
        entries: parameters, signals and other constants of the problem, in its order; n_p
            components in all.
        values: their numbers, (size,) for a parameter, (samples, size) for a signal.
    """

    entries: tuple[Entry, ...]
    values: tuple[np.ndarray, ...]

    @classmethod
    def of(
        cls, entries: Sequence[Entry], given: Mapping[str, ArrayLike] | None
    ) -> "ParameterValues":
        """Return the declared values, replaced by those ``given`` by name, all checked."""
        if given is not None:
            check_instance(given, Mapping, "parameters (values by name)")
        given = dict(given or {})
        values = tuple(np.asarray(e.checked(given.pop(e.name, e.value))) for e in entries)
        if given:
            known = ", ".join(e.name for e in entries) or "none"
            unknown = ", ".join(map(str, given))
            raise ProblemError(f"unknown parameters: {unknown}; declared are: {known}")
        return cls(tuple(entries), values)

    def at(self, fraction: ArrayLike, side: Literal[-1, 1] = 1) -> np.ndarray:
        """Return the stacked parameter vector at fractions of the horizon, (len, n_p)."""
        if not self.entries:
            return np.empty((np.size(fraction), 0))
        points = np.atleast_1d(np.asarray(fraction, dtype=float))
        blocks = [e.at(v, points, side) for e, v in zip(self.entries, self.values, strict=True)]
        return np.hstack([np.empty((len(points), 0)), *blocks])

    def samples(self, count: int) -> np.ndarray:
        """Return the stacked vector where every signal has ``count`` samples, (count, n_p)."""
        nodes = np.linspace(0.0, 1.0, count)
        blocks = [
            v if isinstance(e, Signal) else e.at(v, nodes, 1)
            for e, v in zip(self.entries, self.values, strict=True)
        ]
        return np.hstack(blocks) if blocks else np.empty((count, 0))

    def on(self, fractions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the values at the left and the right end of each interval, (N, n_p) each.

        In between they are interpolated linearly, which is exact where the knots of the
        signals are among the nodes of the grid.
        """
        if not self.entries:
            none = np.empty((len(fractions) - 1, 0))
            return none, none
        return self.at(fractions[:-1], 1), self.at(fractions[1:], -1)

    @property
    def knots(self) -> np.ndarray:
        """All fractions of the horizon at which some signal is not smooth."""
        return np.unique(
            np.concatenate([[0.0, 1.0], *[self._knots(i) for i in range(len(self.values))]])
        )

    def _knots(self, i: int) -> np.ndarray:
        entry = self.entries[i]
        return (
            np.linspace(0.0, 1.0, len(self.values[i])) if isinstance(entry, Signal) else entry.knots
        )

    def as_dict(self) -> dict[str, np.ndarray]:
        """Return name -> value, as ``run(parameters=...)`` takes it."""
        each = zip(self.entries, self.values, strict=True)
        return {e.name: v for e, v in each if not isinstance(e, Steps | Unknown | StartValue)}

    def named(self, name: str) -> np.ndarray | None:
        """Return the value of one entry; None where there is none of that name."""
        each = zip(self.entries, self.values, strict=True)
        return next((value for entry, value in each if entry.name == name), None)
