"""Ends that are coupled, and a budget that is spent: periodic and isoperimetric problems."""

import numpy as np

from benchmarks.cases.case import Published
from benchmarks.cases.library.entry import BONNANS, DIRECT, certified, closed, entry
from models.textbook import dido, periodic_algae

_ANGLE = 2.0 * np.pi / 3.0

CYCLES_AND_BUDGETS = (
    entry(
        dido,
        "dido",
        closed(
            -(_ANGLE - np.sin(_ANGLE)) / (8.0 * np.sin(_ANGLE / 2.0) ** 2),
            "an arc of a circle, (sin θ - θ)/(8 sin²(θ/2)), θ = 2π/3",
        ),
        (*DIRECT, "indirect"),
        "smooth",
        "[Kirk 1970, section 4.5]",
    ),
    entry(
        periodic_algae,
        "periodic-algae",
        certified("periodic-algae"),
        # Meshes that double at dusk and at the switches do not bring every interval below 1e-8.
        ("direct",),
        "state-constrained",
        BONNANS,
        published=(Published(-0.614134, BONNANS),),
    ),
)
