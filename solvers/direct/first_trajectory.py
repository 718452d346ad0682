"""Where a direct method starts: a roll-out that stays tame, and what is tried if it fails."""

from collections.abc import Callable, Iterator

import numpy as np

from ocp import OCP, Box, InitialGuess
from solvers.direct.nlp_outcome import OtherStart

# A roll-out explodes where its second half exceeds the first by this factor, beyond what start
# and bounds suggest: e^(2 lambda T) > 1e4 for a system with the rate lambda.
_EXPLODES = 100.0
# Sizes of the states as compared with each other: below this share of the largest they count more.
_SMALL = 0.01
# A final time that is guessed too short or too long is tried at these multiples.
_MULTIPLES = (4.0, 16.0, 64.0, 0.25)


def tame(x: np.ndarray, x0: np.ndarray, box: Box) -> np.ndarray:
    """Return a roll-out (N + 1, nx), or x0 at all nodes where it explodes or is not finite.

    An unstable system left to itself ends at any size. As a first iterate that is worse than no
    motion at all: it sets the scaling of a backend, and its derivatives are of no use.

    Args:
        x: states of the roll-out.
        x0: start (nx,).
        box: bounds of the states.
    """
    held = np.tile(x0, (len(x), 1))
    if not np.isfinite(x).all():
        return held
    bounds = np.abs(np.vstack([np.asarray(box.lower), np.asarray(box.upper)], dtype=float))
    first = np.abs(x[: len(x) // 2 + 1]).max(axis=0)
    usual = np.maximum(first, np.where(np.isfinite(bounds), bounds, 0.0).max(axis=0))
    usual = np.maximum(usual, _SMALL * usual.max())
    return held if (np.abs(x).max(axis=0) > _EXPLODES * usual).any() and usual.max() else x


def first_duration(ocp: OCP, guess: InitialGuess | None) -> float:
    """Return the duration of the first iterate [s]: the guess's where it is free."""
    return (guess.duration if guess and ocp.has_free_time else None) or ocp.duration


def other_starts(
    ocp: OCP,
    guess: InitialGuess | None,
    duration: float,
    make: Callable[[float, bool], np.ndarray],
) -> Iterator[OtherStart]:
    """Yield first iterates to try where the first one leads nowhere.

    Without states in the guess: the start held. With a free final time: other final times, longer
    ones first.

    Args:
        ocp: the problem.
        guess: of the run.
        duration: of the first iterate [s].
        make: (duration, whether the start is held) -> unknowns.
    """
    has_states = guess is not None and guess.sample("x", np.zeros(1), ocp.model.nx) is not None
    if not has_states:
        yield OtherStart(None, lambda: make(duration, True))
    if not ocp.has_free_time:
        return
    shortest, longest = (float(np.asarray(b)[0]) for b in (ocp.time_box.lower, ocp.time_box.upper))
    tried = [duration]
    for multiple in _MULTIPLES:
        other = float(np.clip(multiple * duration, shortest, longest))
        if other in tried:
            continue
        tried.append(other)
        yield OtherStart(other, lambda other=other: make(other, False))
