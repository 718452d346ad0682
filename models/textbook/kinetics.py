"""Rate constants of chemical reactions, estimated from what was measured."""

import casadi as ca
import numpy as np

from models.textbook.fitting import near_data
from ocp import OCP, Measurement, Model, Unknown

NONE = ca.SX(0, 1)

# Alpha-pinene: minutes; percent of pinene, dipentene, alloocimene, pyronene and dimer.
PINENE_TIMES = np.array([1230.0, 3060.0, 4920.0, 7800.0, 10680.0, 15030.0, 22620.0, 36420.0])
PINENE = np.array([
    [88.35, 7.3, 2.3, 0.4, 1.75],
    [76.4, 15.6, 4.5, 0.7, 2.8],
    [65.1, 23.1, 5.3, 1.1, 5.8],
    [50.4, 32.9, 6.0, 1.5, 9.3],
    [37.5, 42.7, 6.0, 1.9, 12.0],
    [25.9, 49.1, 5.9, 2.2, 17.0],
    [14.0, 57.4, 5.1, 2.6, 21.0],
    [4.5, 63.1, 3.8, 2.9, 25.7],
])  # fmt: skip
# Gas oil: time, gas oil, gasoline.
GAS_OIL_TIMES = np.array([
    0.0, 0.025, 0.05, 0.075, 0.1, 0.125, 0.15, 0.175, 0.2, 0.225, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5,
    0.55, 0.65, 0.75, 0.85, 0.95,
])  # fmt: skip
GAS_OIL = np.array([
    [1.0, 0.8105, 0.6208, 0.5258, 0.4345, 0.3903, 0.3342, 0.3034, 0.2735, 0.2405, 0.2283, 0.2071,
     0.1669, 0.153, 0.1339, 0.1265, 0.12, 0.099, 0.087, 0.077, 0.069],
    [0.0, 0.2, 0.2886, 0.301, 0.3215, 0.3123, 0.2716, 0.2551, 0.2258, 0.1959, 0.1789, 0.1457,
     0.1198, 0.0909, 0.0719, 0.0561, 0.046, 0.028, 0.019, 0.014, 0.01],
]).T  # fmt: skip
# Methanol: time, oxygenates, olefins, paraffins and aromatics.
METHANOL_TIMES = np.array([
    0.0, 0.05, 0.065, 0.08, 0.123, 0.233, 0.273, 0.354, 0.397, 0.418, 0.502, 0.553, 0.681, 0.75,
    0.916, 0.937, 1.122,
])  # fmt: skip
METHANOL = np.array([
    [1.0, 0.7085, 0.5971, 0.5537, 0.3684, 0.1712, 0.1198, 0.0747, 0.0529, 0.0415, 0.0261, 0.0208,
     0.0085, 0.0053, 0.0019, 0.0018, 0.0006],
    [0.0, 0.1621, 0.1855, 0.1989, 0.2845, 0.3491, 0.3098, 0.3576, 0.3347, 0.3388, 0.3557, 0.3483,
     0.3836, 0.3611, 0.3609, 0.3485, 0.3698],
    [0.0, 0.0811, 0.0965, 0.1198, 0.1535, 0.2097, 0.2628, 0.2467, 0.2884, 0.2757, 0.3167, 0.2954,
     0.295, 0.2937, 0.2831, 0.2846, 0.2899],
]).T  # fmt: skip


def alpha_pinene() -> OCP:
    r"""Five rate constants of the isomerisation of alpha-pinene, from 40 measurements.

    .. math::

        \dot y_1 = -(k_1 + k_2) y_1, \; \dot y_2 = k_1 y_1, \;
        \dot y_3 = k_2 y_1 - (k_3 + k_4) y_3 + k_5 y_5, \; \dot y_4 = k_3 y_3, \;
        \dot y_5 = k_4 y_3 - k_5 y_5

    y(0) = (100, 0, 0, 0, 0) percent, time in minutes, k >= 0 in 1e-5 per minute. The sum of the
    squared residuals is minimised.

    Optimum: 19.872 at k = (5.93, 2.96, 2.05, 27.5, 4.00). Problem: [Dolan, More & Munson 2004],
    measurements: [Fuguitt & Hawkins 1947], as [Box et al. 1973] have them.
    """
    y, k = ca.SX.sym("y", 5), ca.SX.sym("k", 5)
    r = 1e-5 * k
    dimer = r[3] * y[2] - r[4] * y[4]
    f = ca.vertcat(
        -(r[0] + r[1]) * y[0], r[0] * y[0], r[1] * y[0] - r[2] * y[2] - dimer, r[2] * y[2], dimer
    )
    start = [100.0, 0.0, 0.0, 0.0, 0.0]
    return OCP(
        name="alpha-pinene",
        model=Model(name="pinene", x=y, u=NONE, f=f),
        x0=start,
        horizon=PINENE_TIMES[-1],
        unknowns=(Unknown("rates", k, [5.0, 3.0, 2.0, 20.0, 5.0], 0.0, 1e3),),
        data=(Measurement("percentages", y, PINENE_TIMES, PINENE),),
        guess=near_data(start, PINENE_TIMES, PINENE),
    )


def gas_oil() -> OCP:
    r"""Three rate constants of catalytic cracking, from 42 measurements.

    .. math::

        \dot y_1 = -(k_1 + k_3) y_1^2, \; \dot y_2 = k_1 y_1^2 - k_2 y_2, \quad y(0) = (1, 0)

    Optimum: 5.23657e-3 at k = (11.85, 8.35, 1.00). Problem: [Dolan, More & Munson 2004], after
    [Tjoa & Biegler 1991].
    """
    y, k = ca.SX.sym("y", 2), ca.SX.sym("k", 3)
    f = ca.vertcat(-(k[0] + k[2]) * y[0] ** 2, k[0] * y[0] ** 2 - k[1] * y[1])
    start = [1.0, 0.0]
    return OCP(
        name="gas oil",
        model=Model(name="cracking", x=y, u=NONE, f=f),
        x0=start,
        horizon=GAS_OIL_TIMES[-1],
        unknowns=(Unknown("rates", k, [5.0, 5.0, 5.0], 0.0, 20.0),),
        data=(Measurement("fractions", y, GAS_OIL_TIMES, GAS_OIL),),
        guess=near_data(start, GAS_OIL_TIMES, GAS_OIL),
    )


def methanol() -> OCP:
    r"""Five constants of methanol becoming hydrocarbons, from 51 measurements: a DAE.

    z, k_1 times what there is of the carbene that all reactions share, is an algebraic variable:

    .. math::

        0 &= z \, ((k_2 + k_5) y_1 + y_2) - k_1 y_1 \\
        \dot y_1 &= -(2 k_2 + k_3 + k_4) y_1 + z y_2 \\
        \dot y_2 &= z (k_2 y_1 - y_2) + k_3 y_1 \\
        \dot y_3 &= z (y_2 + k_5 y_1) + k_4 y_1, \qquad y(0) = (1, 0, 0), \; k \ge 0

    Optimum: 9.02229e-3. Problem: [Dolan, More & Munson 2004], where z is eliminated, after
    [Maria 1989].
    """
    y, k, z = ca.SX.sym("y", 3), ca.SX.sym("k", 5), ca.SX.sym("z")
    f = ca.vertcat(
        -(2.0 * k[1] + k[2] + k[3]) * y[0] + z * y[1],
        z * (k[1] * y[0] - y[1]) + k[2] * y[0],
        z * (y[1] + k[4] * y[0]) + k[3] * y[0],
    )
    carbene = z * ((k[1] + k[4]) * y[0] + y[1]) - k[0] * y[0]
    start = [1.0, 0.0, 0.0]
    return OCP(
        name="methanol",
        model=Model(name="methanol", x=y, u=NONE, f=f, z=z, algebraic=carbene, z_guess=[1.0]),
        x0=start,
        horizon=METHANOL_TIMES[-1],
        unknowns=(Unknown("rates", k, [1.0, 1.0, 1.0, 1.0, 1.0], 0.0, 100.0),),
        data=(Measurement("fractions", y, METHANOL_TIMES, METHANOL),),
        guess=near_data(start, METHANOL_TIMES, METHANOL),
    )
