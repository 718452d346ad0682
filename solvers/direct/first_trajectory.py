"""Where a direct method starts: a roll-out that stays tame, and what is tried if it fails."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Literal

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


# Where a first iterate without states gets them from: the start held, the roll-out as it is, or
# the roll-out if it is tame, else the start held.
FirstStates = Literal["tame", "held", "rolled out"]
# What is tried where the tame one leads nowhere.
OTHER_STATES: tuple[FirstStates, ...] = ("held", "rolled out")


def first_states(
    x0: np.ndarray, nodes: int, box: Box, rollout: Callable[[], np.ndarray], source: FirstStates
) -> np.ndarray:
    """Return the states of a first iterate whose guess has none, (N + 1, nx); they are finite.

    An unstable system left to itself ends at any size. As a first iterate that is worse than no
    motion at all: it sets the scaling of a backend, and its derivatives are of no use.

    Args:
        x0: start (nx,).
        nodes: number of nodes.
        box: bounds of the states.
        rollout: returns the states under the controls of the guess.
        source: see ``FirstStates``.
    """
    held = np.tile(x0, (nodes, 1))
    if source == "held":
        return held
    x = rollout()
    if not np.isfinite(x).all() or (source == "tame" and explodes(x, box)):
        return held
    return x


def explodes(x: np.ndarray, box: Box) -> np.ndarray:
    """Return whether roll-outs (..., N + 1, nx) grow beyond all that suggests their size, (...)."""
    bounds = np.abs(np.vstack([np.asarray(box.lower), np.asarray(box.upper)], dtype=float))
    first = np.abs(x[..., : x.shape[-2] // 2 + 1, :]).max(axis=-2)
    usual = np.maximum(first, np.where(np.isfinite(bounds), bounds, 0.0).max(axis=0))
    usual = np.maximum(usual, _SMALL * usual.max(axis=-1, keepdims=True))
    is_beyond = np.abs(x).max(axis=-2) > _EXPLODES * usual
    return is_beyond.any(axis=-1) & (usual.max(axis=-1) > 0.0)


def first_duration(ocp: OCP, guess: InitialGuess | None) -> float:
    """Return the duration of the first iterate [s]: the guess's where it is free."""
    return (guess.duration if guess and ocp.has_free_time else None) or ocp.duration


def other_starts(
    ocp: OCP,
    guess: InitialGuess | None,
    duration: float,
    make: Callable[[float, FirstStates], np.ndarray],
) -> Iterator[OtherStart]:
    """Yield first iterates to try where the first one leads nowhere.

    Without states in the guess: the start held, and the roll-out if that was refused. With a free
    final time: other final times, longer ones first.

    Args:
        ocp: the problem.
        guess: of the run.
        duration: of the first iterate [s].
        make: (duration, where the states come from) -> unknowns.
    """
    has_states = guess is not None and guess.sample("x", np.zeros(1), ocp.model.nx) is not None
    if not has_states:
        for source in OTHER_STATES:
            yield OtherStart(f"the start {source}", None, partial(make, duration, source))
    if not ocp.has_free_time:
        return
    shortest, longest = (float(np.asarray(b)[0]) for b in (ocp.time_box.lower, ocp.time_box.upper))
    tried = [duration]
    for multiple in _MULTIPLES:
        other = float(np.clip(multiple * duration, shortest, longest))
        if other in tried:
            continue
        tried.append(other)
        said = f"a guess of the final time of {other:.4g} s"
        yield OtherStart(said, other, partial(make, other, "tame"))
