"""Textbook problems with exact or certified optimal values."""

from benchmarks.cases.case import Case, Family
from models import (
    bryson_denham,
    double_integrator_energy,
    double_integrator_minimum_time,
    hypersensitive,
    rayleigh,
    van_der_pol,
)

_SMOOTH: frozenset[Family] = frozenset({"direct", "indirect", "polish"})
_FREE_END: frozenset[Family] = frozenset({"direct", "indirect", "polish", "gradient"})
_CERTIFIED = "direct and indirect methods agree to 10 digits (docs/references.md)"

TEXTBOOK = (
    Case(
        name="double-integrator-energy",
        suite="textbook",
        build=double_integrator_energy,
        reference=6.0,
        source="closed form: u = 6 - 12 t",
        families=_SMOOTH,
        costate0=(-12.0, -6.0),
    ),
    Case(
        name="double-integrator-minimum-time",
        suite="textbook",
        build=double_integrator_minimum_time,
        reference=2.0,
        source="closed form: bang-bang with one switch at t = 1",
        families=frozenset({"direct"}),
    ),
    Case(
        name="bryson-denham",
        suite="textbook",
        build=bryson_denham,
        reference=4.0,
        source="closed form, 4/(9 l) with l = 1/9 [Bryson & Ho 1975, 3.11]",
        families=frozenset({"direct"}),
    ),
    Case(
        name="van-der-pol",
        suite="textbook",
        build=van_der_pol,
        reference=1.047806908220,
        source=_CERTIFIED,
        families=_FREE_END,
    ),
    Case(
        name="rayleigh",
        suite="textbook",
        build=rayleigh,
        reference=29.376079655945,
        source=_CERTIFIED,
        families=_FREE_END,
    ),
    Case(
        name="hypersensitive",
        suite="textbook",
        build=hypersensitive,
        reference=1.330806904945,
        source=_CERTIFIED,
        families=frozenset({"direct", "polish"}),
    ),
)
