"""The linear problems of the thesis' second chapter."""

from functools import partial

import numpy as np

from benchmarks.cases.library.entry import DISCRETE, SMOOTH, certified, entry, root
from models import (
    lq_regulator,
    mass_spring_damper,
    stable_plant,
    thesis_regulator,
    thesis_tracking,
    unstable_plant,
)
from models.textbook import discrete_double_integrator
from ocp import OCP

_RICCATI = "Riccati recursion"


def _stable() -> OCP:
    return thesis_regulator(stable_plant(), 50)


def _unstable() -> OCP:
    return thesis_regulator(unstable_plant(), 50)


def _mass() -> OCP:
    """The mass of (2.92) with the weights of (2.94), continuous and without bounds."""
    plant = mass_spring_damper()
    return lq_regulator(plant, Q=[100.0, 10.0], R=0.5, P=100.0, x0=np.array([1.0, 0.0]), horizon=4)


CHAPTER_2 = (
    entry(
        _stable,
        "stable-plant",
        root(4051.2550447694803, _RICCATI),
        DISCRETE,
        "easy",
        "thesis (2.50), (2.55), N = 50",
    ),
    entry(
        _unstable,
        "unstable-plant",
        root(5280.441131251924, _RICCATI),
        DISCRETE,
        "easy",
        "thesis (2.53), (2.55), N = 50",
    ),
    entry(
        partial(discrete_double_integrator, 20, 0.1),
        "discrete-double-integrator",
        root(16.02339452102853, _RICCATI),
        (*DISCRETE, "gradient"),
        "easy",
        "thesis (2.39)",
        costate0=(32.04678904, 16.92816783),
    ),
    entry(
        _mass,
        "mass-on-a-spring",
        root(53.2671158515607, "Riccati, by the exponential of the Hamiltonian matrix"),
        SMOOTH,
        "easy",
        "thesis (2.92)",
        costate0=(106.5342317, 16.28285686),
    ),
    entry(
        partial(thesis_tracking, 80),
        "mass-tracking",
        certified("mass-tracking"),
        DISCRETE,
        "state-constrained",
        "thesis (2.92) to (2.94), N = 80",
    ),
)
