"""Smooth nonlinear problems."""

from dataclasses import replace

import numpy as np

from benchmarks.cases.case import Published
from benchmarks.cases.library.entry import (
    BONNANS,
    DIRECT,
    DOLAN,
    FREE_END,
    RUTQUIST,
    SMOOTH,
    certified,
    entry,
    root,
)
from models import cart_pole_swing_up
from models.textbook import (
    brachistochrone,
    electric_vehicle,
    hanging_chain,
    hypersensitive,
    isoperimetric,
    linear_tangent_steering,
    pendulum_swing_up,
    rayleigh,
    van_der_pol,
    zermelo,
)
from ocp import OCP, Guess


def _swung_back_first() -> OCP:
    """The cart-pole with a guess in the basin of its best known optimum.

    The straight guess leads to a local one that costs 58.807667.
    """
    x = [[0, 0, 0, 0], [-0.1, 0, 0.8, -2], [0.6, -1, 2, 0], [0.9, 0.6, -1, 8], [0.8, 2.6, 0, 2]]
    return replace(cart_pole_swing_up(), guess=Guess(x=[*x, [1, np.pi, 0, 0]]))


SMOOTH_PROBLEMS = (
    entry(
        van_der_pol,
        "van-der-pol",
        certified("van-der-pol"),
        FREE_END,
        "smooth",
        BONNANS,
        published=(Published(1.047921, BONNANS),),
    ),
    entry(
        rayleigh,
        "rayleigh",
        certified("rayleigh"),
        FREE_END,
        "smooth",
        "[Maurer & Augustin 2001]",
    ),
    entry(
        hypersensitive,
        "hypersensitive",
        certified("hypersensitive"),
        (*DIRECT, "polish"),
        "long",
        "[Rao & Mease 2000]",
    ),
    entry(
        pendulum_swing_up,
        "pendulum-swing-up",
        certified("pendulum-swing-up"),
        SMOOTH,
        "nonconvex",
        "made for this library",
        local_costs=(0.588575, 30.847204),
    ),
    entry(
        _swung_back_first,
        "cart-pole-swing-up",
        certified("cart-pole-swing-up"),
        DIRECT,
        "nonconvex",
        "[Kelly 2017]",
        local_costs=(58.807667458,),
    ),
    entry(
        zermelo,
        "zermelo",
        root(5.457865263561, "two equations for the headings at both ends"),
        (*DIRECT, "indirect"),
        "smooth",
        "[Bryson & Ho 1975, section 2.7, example 1]",
        published=(Published(5.46, "[Bryson & Ho 1975, section 2.7, example 1]"),),
    ),
    entry(
        brachistochrone,
        "brachistochrone",
        root(0.824759143157, "cycloid through the end, φ - sin φ = 1 - cos φ"),
        (*DIRECT, "indirect"),
        "smooth",
        "[Bryson & Ho 1975, section 2.7]",
    ),
    entry(
        linear_tangent_steering,
        "linear-tangent-steering",
        root(0.554570878335, "two equations for the first angle and the time"),
        (*DIRECT, "indirect"),
        "smooth",
        DOLAN,
    ),
    entry(
        hanging_chain,
        "hanging-chain",
        root(5.068480110993, "catenary of the given length"),
        (*DIRECT, "indirect"),
        "smooth",
        DOLAN,
        published=(Published(5.068480111, RUTQUIST),),
    ),
    entry(
        isoperimetric,
        "isoperimetric",
        certified("isoperimetric"),
        (*DIRECT, "indirect"),
        "smooth",
        RUTQUIST,
        published=(Published(-0.375495523, RUTQUIST),),
    ),
    entry(
        electric_vehicle,
        "electric-vehicle",
        certified("electric-vehicle"),
        SMOOTH,
        "smooth",
        "[Petit & Sciarretta 2011]",
        published=(Published(1.23e6, BONNANS),),
    ),
)
