"""Bang-bang, chattering and singular problems."""

from functools import partial

from benchmarks.cases.case import Published
from benchmarks.cases.library.entry import BETWEEN, BONNANS, DIRECT, DOLAN, computed, entry, root
from models.textbook import catalyst_mixing, fuller, goddard, pendulum_minimum_time, two_catalysts

_ARCS = "shooting on the arcs of the minimum principle"
_TUBE = "exponentials of three linear arcs, least over switches and singular control"

SWITCHING = (
    entry(
        fuller,
        "fuller",
        root(0.268393830569, "geometric sum over the self-similar arcs"),
        DIRECT,
        "bang-bang",
        "[Fuller 1963]",
        published=(Published(0.2683944, BONNANS),),
    ),
    entry(
        pendulum_minimum_time,
        "pendulum-minimum-time",
        computed(7.586693492820, 1e-9, "switching times optimised; best of 16 starts"),
        DIRECT,
        "bang-bang",
        "made for this library",
    ),
    entry(
        catalyst_mixing,
        "catalyst-mixing",
        root(-0.048055685861, _TUBE),
        (*DIRECT, "gradient"),
        "singular",
        DOLAN,
    ),
    entry(
        two_catalysts,
        "two-catalysts",
        root(-0.191814356325, _TUBE),
        (*DIRECT, "gradient"),
        "singular",
        "[Jackson 1968]",
        published=(Published(-0.192011, BONNANS),),
    ),
    entry(
        goddard,
        "goddard",
        computed(-1.0128369183175, 1e-11, f"{_ARCS}: full, singular, none"),
        BETWEEN,
        "singular",
        DOLAN,
        costate0=(-4.57290023, -0.17429931, -0.06224975),
    ),
    entry(
        partial(goddard, fastest=0.1),
        "goddard-slow",
        computed(-1.0125763246569, 1e-11, f"{_ARCS}: full, singular, limit, none"),
        # Refined collocation ends with an interval that is wrong by 1.6e-8 on the singular arc, and
        # 1e-8 is asked; its cost is within 7e-8.
        ("direct", "between"),
        "singular",
        "[Bonnans et al. 2017], after [Bryson & Ho 1975]",
        published=(Published(-1.01257, BONNANS),),
        costate0=(-3.94576466, -0.15039560, -0.05371271),
    ),
)
