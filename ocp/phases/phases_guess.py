"""Where a solver of phases starts: a guess for each, as one for all side by side."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.errors import ProblemError
from ocp.method.in_normal_form import InNormalForm
from ocp.phases.chain import Chain
from ocp.phases.phases_solution import PhasesSolution
from ocp.phases.side_by_side import Lane, SideBySide
from ocp.problem.guess import Guess
from ocp.problem.run_data import RunData
from ocp.solution.solver import InitialGuess

# Instants at which the guesses of the phases are looked at.
_SAMPLES = 201

#: What a run of phases may start from.
PhasesGuess = Sequence[InitialGuess | None] | PhasesSolution


def checked_guess(chain: Chain, given: Any) -> PhasesGuess | None:
    """Return a guess that has a part for each phase, or is a solution of phases, or None."""
    if given is None or isinstance(given, PhasesSolution):
        return given
    count = len(chain.phases)
    if not isinstance(given, tuple | list) or len(given) != count:
        raise ProblemError(
            f"{chain.name}: a guess of phases is a solution of them, or a sequence of {count} with "
            f"one Guess, Solution or None for each of {', '.join(chain.names)}"
        )
    for phase, guess in zip(chain.phases, given, strict=True):
        phase.first_guess(guess)
    return tuple(given)


def guess_of_all(
    side: SideBySide, given: PhasesGuess | None, data: Sequence[RunData]
) -> InitialGuess | None:
    """Return a guess of the one problem; None where nothing is known.

    Args:
        side: the phases side by side.
        given: of the caller; without one the phases' own guesses.
        data: what a run gives each phase.
    """
    shared: dict[str, ArrayLike] = {}
    if isinstance(given, PhasesSolution):
        if given.whole.problem.model.x_names == side.problem.model.x_names:
            return given.whole
        shared = _shared(side.chain, given)
        given = checked_guess(side.chain, given.phases)
        assert not isinstance(given, PhasesSolution)
    each = given or (None,) * len(side.lanes)
    guesses = [lane.phase.first_guess(guess) for lane, guess in zip(side.lanes, each, strict=True)]
    if not shared and all(guess is None for guess in guesses):
        return None
    durations = {
        lane.named("duration"): (guess.duration if guess else None) or lane.phase.duration
        for lane, guess in zip(side.lanes, guesses, strict=True)
        if lane.has_free_time
    }
    sampled = [_Sampled.of(*each) for each in zip(side.lanes, guesses, data, strict=True)]
    return Guess(
        x=_joined([s.x for s in sampled], [s.start for s in sampled]),
        u=_joined([s.u for s in sampled], [s.rest for s in sampled]),
        costate=_joined([s.costate for s in sampled], [0.0 * s.start for s in sampled]),
        unknowns={**shared, **durations},
    )


def _shared(chain: Chain, given: PhasesSolution) -> dict[str, ArrayLike]:
    """Return the values of unknown constants of all phases that another solution knows."""
    known = {u: given.unknowns[u.name] for u in chain.unknowns if u.name in given.unknowns}
    return {
        u.name: np.clip(value, u.box.lower, u.box.upper)
        for u, value in known.items()
        if value.size == u.symbol.numel()
    }


class _Sampled(NamedTuple):
    """What is known of a phase in its normal form, and what stands for the rest."""

    x: np.ndarray | None
    u: np.ndarray | None
    costate: np.ndarray | None
    start: np.ndarray
    rest: np.ndarray

    @classmethod
    def of(cls, lane: Lane, guess: InitialGuess | None, data: RunData) -> "_Sampled":
        m, at = lane.base.model, np.linspace(0.0, 1.0, _SAMPLES)
        start, rest = start_of(lane, data), lane.base.control_bounds.clip(np.zeros(m.nu))
        if guess is None:
            return cls(None, None, None, start, rest)
        if lane.form is not None:
            guess = InNormalForm(lane.form).guess(guess, data)
        x, costate = (guess.sample(part, at, m.nx) for part in ("x", "costate"))
        return cls(x, guess.sample("u", at, m.nu), costate, start, rest)


def start_of(lane: Lane, data: RunData) -> np.ndarray:
    """Return the start of a phase in normal form (nx,), for a run of it."""
    return data.x0 if lane.form is None else InNormalForm(lane.form).start(data)


def _joined(parts: list[np.ndarray | None], instead: list[np.ndarray]) -> np.ndarray | None:
    """Return the parts of all phases beside each other; None where no guess knows any."""
    if all(part is None for part in parts):
        return None
    each = zip(parts, instead, strict=True)
    return np.hstack([np.tile(row, (_SAMPLES, 1)) if p is None else p for p, row in each])
