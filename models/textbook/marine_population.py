"""Growth and mortality of a marine species, estimated from counts of its eight stages."""

import casadi as ca
import numpy as np

from models.textbook.fitting import near_data
from ocp import OCP, Box, Measurement, Model, Unknown

TIMES = np.linspace(0.0, 10.0, 21)
COUNTS = np.array([
    [20000, 17000, 10000, 15000, 12000, 9000, 7000, 3000],
    [12445, 15411, 13040, 13338, 13484, 8426, 6615, 4022],
    [7705, 13074, 14623, 11976, 12453, 9272, 6891, 5020],
    [4664, 8579, 12434, 12603, 11738, 9710, 6821, 5722],
    [2977, 7053, 11219, 11340, 13665, 8534, 6242, 5695],
    [1769, 5054, 10065, 11232, 12112, 9600, 6647, 7034],
    [943, 3907, 9473, 10334, 11115, 8826, 6842, 7348],
    [581, 2624, 7421, 10297, 12427, 8747, 7199, 7684],
    [355, 1744, 5369, 7748, 10057, 8698, 6542, 7410],
    [223, 1272, 4713, 6869, 9564, 8766, 6810, 6961],
    [137, 821, 3451, 6050, 8671, 8291, 6827, 7525],
    [87, 577, 2649, 5454, 8430, 7411, 6423, 8388],
    [49, 337, 2058, 4115, 7435, 7627, 6268, 7189],
    [32, 228, 1440, 3790, 6474, 6658, 5859, 7467],
    [17, 168, 1178, 3087, 6524, 5880, 5562, 7144],
    [11, 99, 919, 2596, 5360, 5762, 4480, 7256],
    [7, 65, 647, 1873, 4556, 5058, 4944, 7538],
    [4, 44, 509, 1571, 4009, 4527, 4233, 6649],
    [2, 27, 345, 1227, 3677, 4229, 3805, 6378],
    [1, 20, 231, 934, 3197, 3695, 3159, 6454],
    [1, 12, 198, 707, 2562, 3163, 3232, 5566],
], dtype=float)  # fmt: skip


def marine_population() -> OCP:
    r"""Rates of growth g and mortality m of eight stages, and where they start, from 168 counts.

    .. math::

        \dot y_1 = -(m_1 + g_1) y_1, \; \dot y_j = g_{j-1} y_{j-1} - (m_j + g_j) y_j, \;
        \dot y_8 = g_7 y_7 - m_8 y_8, \quad g, m \ge 0

    The start is free. Counts are in thousands: in individuals the cost is 1e6 times as much.

    Optimum: 19.7465. Problem: [Dolan, More & Munson 2004], after [Rothschild et al. 1997].
    """
    y, growth, mortality = ca.SX.sym("y", 8), ca.SX.sym("g", 7), ca.SX.sym("m", 8)
    grown = growth * y[:7]
    f = ca.vertcat(0.0, grown) - ca.vertcat(grown, 0.0) - mortality * y
    thousands = COUNTS / 1e3
    return OCP(
        name="marine population",
        model=Model(name="stages", x=y, u=ca.SX(0, 1), f=f),
        x0=thousands[0],
        horizon=TIMES[-1],
        free_start=tuple(f"y_{i}" for i in range(8)),
        start_bounds=Box(0.0, 100.0),
        unknowns=(
            Unknown("growth", growth, np.full(7, 0.5), 0.0, 10.0),
            Unknown("mortality", mortality, np.full(8, 0.1), 0.0, 10.0),
        ),
        data=(Measurement("counts", y, TIMES, thousands),),
        guess=near_data(thousands[0], TIMES, thousands),
    )
