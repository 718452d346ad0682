"""Mistakes that people make, planted in sound problems, and the sound problems themselves."""

from benchmarks.mistakes.afterwards import AFTERWARDS
from benchmarks.mistakes.mistake import Mistake, Sound
from benchmarks.mistakes.sound import SOUND
from benchmarks.mistakes.wrong_constants import CONSTANTS
from benchmarks.mistakes.wrong_constraints import CONSTRAINTS
from benchmarks.mistakes.wrong_costs import COSTS
from benchmarks.mistakes.wrong_meanings import MEANINGS
from benchmarks.mistakes.wrong_numerics import NUMERICS

MISTAKES: tuple[Mistake, ...] = (
    *COSTS,
    *CONSTRAINTS,
    *NUMERICS,
    *CONSTANTS,
    *MEANINGS,
    *AFTERWARDS,
)

__all__ = ["MISTAKES", "SOUND", "Mistake", "Sound"]
