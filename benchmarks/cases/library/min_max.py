"""The largest value along the way as the cost."""

from benchmarks.cases.library.entry import DIRECT, closed, entry
from models.textbook import least_excursion, least_jerk

MIN_MAX = (
    entry(
        least_jerk,
        "least-jerk",
        closed(32.0, "32 d/T³: a quarter, a half, a quarter"),
        DIRECT,
        "bang-bang",
        "made for closed forms",
    ),
    entry(
        least_excursion,
        "least-excursion",
        closed(1.0 / 9.0, "4/(9 E) with E = 4"),
        DIRECT,
        "state-constrained",
        "[Bryson & Ho 1975, section 3.11], cost and wall exchanged",
    ),
)
