"""Cars, a crane, and vehicles that cannot turn at once."""

import numpy as np

from benchmarks.cases.case import Published
from benchmarks.cases.library.entry import (
    DIRECT,
    certified,
    closed,
    entry,
    root,
)
from models.textbook import (
    car_minimum_time,
    interceptor,
    mountain_car,
    overhead_crane,
    shortest_turn,
)

_PEAK = np.sqrt(np.tanh(4.0))

VEHICLES = (
    entry(
        car_minimum_time,
        "car-minimum-time",
        closed(
            500.0 / np.sqrt(5000.0) * (np.arctanh(_PEAK) + np.arctan(_PEAK)),
            "k (artanh s + arctan s), k = 5 √2, s = √(tanh 4)",
        ),
        DIRECT,
        "bang-bang",
        "an example of rockit, [Gillis et al. 2020]",
    ),
    entry(
        shortest_turn,
        "shortest-turn",
        closed(np.sqrt(12.0) + (np.pi - np.arccos(1.0 / 7.0)) / 2.0, "√12 + (π - arccos(1/7))/2"),
        DIRECT,
        "singular",
        "[Dubins 1957], an example of GEKKO",
        published=(Published(6.018514, "a test of GEKKO"),),
        local_costs=(7.462766,),
    ),
    entry(
        interceptor,
        "interceptor",
        root(9.444250747830, "turn and straight line, two equations for the turn and the meeting"),
        DIRECT,
        "singular",
        "after [Dubins 1957]",
        local_costs=(10.574906,),
    ),
    entry(
        mountain_car,
        "mountain-car",
        certified("mountain-car"),
        DIRECT,
        "bang-bang",
        "[Melnikov, Makmal & Briegel 2014], an example of dymos",
        published=(Published(102.479, "an example of dymos"),),
    ),
    entry(
        overhead_crane,
        "overhead-crane",
        root(0.952633251158, "d' (C W C')⁻¹ d, W the Gramian of the crane with its rate"),
        # No 300 steps: they leave 7e-8 over 9 s.
        (*DIRECT, "polish"),
        "easy",
        "linear after [Sakawa & Shindo 1982]",
    ),
)
