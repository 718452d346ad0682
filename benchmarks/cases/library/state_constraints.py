"""Nonlinear problems with a constraint along the path."""

import numpy as np

from benchmarks.cases.case import Published
from benchmarks.cases.library.entry import DIRECT, certified, closed, entry
from models.textbook import around_discs, rayleigh_constrained

# Around the disc: from its tangent through the start to that through the end.
_TURNED = np.arctan2(1.1, 0.8) - np.arctan2(0.5, 0.4)
_TURNED += np.arcsin(np.sqrt(0.1 / 1.85)) + np.arcsin(np.sqrt(0.1 / 0.41))

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
    entry(
        around_discs,
        "around-discs",
        closed(
            np.sqrt(0.31) + np.sqrt(0.1) * _TURNED + np.sqrt(1.75),
            "a string: tangent, arc, tangent",
        ),
        DIRECT,
        "state-constrained",
        "[Becerra 2010], after [Rutquist & Edvall 2010]",
        published=(Published(2.138, "[Becerra 2010]: a local optimum, between the discs"),),
        local_costs=(2.13784926766,),
    ),
)
