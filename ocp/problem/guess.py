"""Where a solver starts: any part of a trajectory, from anywhere."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_instance, check_numeric, check_positive
from ocp.checks.errors import ProblemError
from ocp.problem.parameters import Unknown


@dataclass(frozen=True, eq=False, kw_only=True)
class Guess:
    """A first guess; every part may be left out.

    A part is one row (n,), held over the whole horizon, or (N + 1, n) equally spaced
    samples, interpolated linearly.

    Args:
        x: states.
        u: controls.
        costate: costates dJ*/dx; one row is the plain psi(t0) of the thesis (3.50).
        duration: final time minus t0 [s], where it is free.
        unknowns: values of unknown constants, by name.
    """

    x: ArrayLike | None = None
    u: ArrayLike | None = None
    costate: ArrayLike | None = None
    duration: float | None = None
    unknowns: Mapping[str, ArrayLike] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Return one line: which parts it has, and how many samples."""
        parts = [
            f"{name} {np.shape(value)}"
            for name, value in (("x", self.x), ("u", self.u), ("costate", self.costate))
            if value is not None
        ]
        parts += [f"duration {self.duration:g} s"] if self.duration is not None else []
        parts += [f"unknowns {', '.join(self.unknowns)}"] if self.unknowns else []
        return f"<Guess: {', '.join(parts) or 'nothing'}>"

    def __post_init__(self) -> None:
        """Check the duration; the shapes are checked where they are known."""
        check_instance(self.unknowns, Mapping, "guess: unknowns (values by name)")
        if self.duration is not None:
            check_positive(self.duration, "guess: duration")

    def sample(self, part: str, fractions: np.ndarray, width: int) -> np.ndarray | None:
        """Return one part at fractions of the horizon, (len(fractions), width), or None.

        Raises:
            ProblemError: naming the part whose shape is wrong or which is not finite.
        """
        value = getattr(self, part)
        if value is None:
            return None
        rows = np.atleast_2d(check_numeric(value, f"guess: {part}"))
        if rows.ndim != 2 or rows.shape[1] != width:
            raise ProblemError(
                f"guess: {part} has shape {rows.shape}, ({width},) or (N + 1, {width}) is needed"
            )
        if not np.isfinite(rows).all():
            raise ProblemError(f"guess: {part} is not finite")
        if len(rows) == 1:
            return np.repeat(rows, len(fractions), axis=0)
        nodes = np.linspace(0.0, 1.0, len(rows))
        columns = [np.interp(fractions, nodes, c) for c in rows.T]
        return np.array(columns).reshape(width, len(fractions)).T


def check_guess(owner: str, guess: object, unknowns: Iterable[Unknown]) -> None:
    """Refuse what cannot be sampled, and values of what is no unknown constant; None is none.

    Args:
        owner: name of the problem.
        guess: of a user.
        unknowns: of the problem.

    Raises:
        ProblemError: naming what is wrong.
    """
    # A class has the method as well, but nothing to call it with.
    if guess is not None and (isinstance(guess, type) or not hasattr(guess, "sample")):
        raise ProblemError(
            f"{owner}: the guess is {guess if isinstance(guess, type) else type(guess)}, "
            "a Guess(x=..., u=..., costate=..., duration=...) or a Solution is needed"
        )
    if not isinstance(guess, Guess):
        return
    entries = {entry.name: entry for entry in unknowns}
    for name, value in guess.unknowns.items():
        if name not in entries:
            known = ", ".join(entries) or "none"
            raise ProblemError(
                f"{owner}: guess: '{name}' is no unknown constant; declared are: {known}"
            )
        entries[name].checked(value)
