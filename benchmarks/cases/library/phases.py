"""Problems in phases: the arcs of a bang-bang control, impacts, burns, the stages of a rocket."""

import numpy as np

from benchmarks.cases.case import PhasesCase, Published
from benchmarks.cases.library.entry import certified, closed, computed, root
from models.textbook import bouncing_ball, car_in_arcs, orbit_raise, staged_ascent

SUITE = "phases"
_PEAK = np.sqrt(np.tanh(4.0))

PHASES: tuple[PhasesCase, ...] = (
    PhasesCase(
        name="car-in-arcs",
        suite=SUITE,
        build=car_in_arcs,
        source="an example of rockit, [Gillis et al. 2020], its arcs as phases",
        reference=closed(
            500.0 / np.sqrt(5000.0) * (np.arctanh(_PEAK) + np.arctan(_PEAK)),
            "that of car-minimum-time",
        ),
        difficulty="easy",
        families=frozenset({"direct", "collocation"}),
    ),
    PhasesCase(
        name="bouncing-ball",
        suite=SUITE,
        build=bouncing_ball,
        source="made for this library",
        reference=root(
            14.761229796653, "cubic flights, least over two speeds and two times between impacts"
        ),
        difficulty="easy",
        families=frozenset({"direct", "collocation", "polish"}),
    ),
    PhasesCase(
        name="orbit-raise",
        suite=SUITE,
        build=orbit_raise,
        source="an example of dymos, after [Enright 1991]",
        reference=certified("orbit-raise"),
        difficulty="smooth",
        families=frozenset({"direct", "collocation"}),
        published=(Published(0.3995, "an example of dymos"),),
    ),
    PhasesCase(
        name="staged-ascent",
        suite=SUITE,
        build=staged_ascent,
        source="[Betts 2010]",
        reference=computed(
            -7529.712297, 2e-6, "collocation on Radau and on Gauss points, 16 intervals a phase"
        ),
        difficulty="smooth",
        families=frozenset({"collocation"}),
        published=(Published(-7529.712287, "a test of YAPSS"),),
    ),
)
