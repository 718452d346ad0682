"""Nonlinear problems with a constraint along the path."""

from benchmarks.cases.case import Published
from benchmarks.cases.library.entry import DIRECT, certified, entry
from models.textbook import rayleigh_constrained

STATE_CONSTRAINTS = (
    entry(
        rayleigh_constrained,
        "rayleigh-constrained",
        certified("rayleigh-constrained"),
        DIRECT,
        "mixed-constrained",
        "[Maurer & Augustin 2001], [Betts 2010, example 4.10]",
        published=(Published(44.77625, "on a mesh: below the minimum"),),
    ),
)
