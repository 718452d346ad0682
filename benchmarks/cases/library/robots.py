"""Robot arms with their dynamics."""

from benchmarks.cases.library.entry import (
    BETWEEN,
    DIRECT,
    DOLAN,
    SMOOTH,
    certified,
    computed,
    entry,
)
from models.textbook import polar_arm, two_link_arm_energy, two_link_arm_minimum_time

_SWITCHED = "switching times optimised; best of 16 starts"

ROBOTS = (
    entry(
        two_link_arm_energy,
        "two-link-arm-energy",
        certified("two-link-arm-energy"),
        SMOOTH,
        "nonconvex",
        "made for this library",
        local_costs=(2.91092, 7.636832),
    ),
    entry(
        two_link_arm_minimum_time,
        "two-link-arm-minimum-time",
        computed(1.113835773316, 1e-10, _SWITCHED),
        DIRECT,
        "bang-bang",
        "made for this library",
        local_costs=(1.196752,),
    ),
    entry(
        polar_arm,
        "polar-arm",
        computed(9.140911745915, 1e-10, _SWITCHED),
        BETWEEN,
        "bang-bang",
        DOLAN,
    ),
)
