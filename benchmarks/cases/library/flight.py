"""Landing, gliding, re-entry, and a low thrust."""

import numpy as np

from benchmarks.cases.case import Published
from benchmarks.cases.library.entry import DIRECT, SMOOTH, certified, entry, root
from models.textbook import hang_glider, moon_landing, orbit_transfer, shuttle_reentry

FLIGHT = (
    entry(
        moon_landing,
        "moon-landing",
        root(-0.395354363964, "fall and brake, two equations for their times"),
        DIRECT,
        "bang-bang",
        "[Meditch 1964], data of an example of dymos",
        published=(Published(-0.3953, "an example of dymos"),),
    ),
    entry(
        orbit_transfer,
        "orbit-transfer",
        certified("orbit-transfer"),
        SMOOTH,
        "smooth",
        "[Bryson & Ho 1975, section 2.5]",
        published=(Published(-1.525, "[Bryson & Ho 1975, section 2.5]"),),
    ),
    entry(
        hang_glider,
        "hang-glider",
        certified("hang-glider"),
        # Where the lift meets its bound within an interval a refined mesh keeps an error of 3e-9.
        ("direct",),
        "long",
        "[Bulirsch et al. 1993], data of [Dolan, More & Munson 2004]",
    ),
    entry(
        shuttle_reentry,
        "shuttle-reentry",
        certified("shuttle-reentry"),
        DIRECT,
        "long",
        "[Betts 2010, section 6.1]",
        published=(Published(-np.radians(34.1412), "34.1412 deg, a table of PSOPT"),),
    ),
)
