"""Rates of an infection with HIV, estimated from the viral load of one patient."""

import casadi as ca
import numpy as np

from ocp import OCP, RK4, Guess, Measurement, Model, Unknown

TIMES = np.linspace(0.0, 15.0, 61)
# log10 of the viral load.
LOADS = np.array([
    1.20, 1.67, 2.06, 2.05, 3.57, 2.96, 2.95, 3.48, 3.27, 2.98, 4.17, 4.41, 4.16, 3.94, 4.44, 4.60,
    5.15, 5.34, 6.56, 5.16, 6.63, 6.60, 6.59, 6.28, 6.79, 6.81, 7.16, 7.06, 7.19, 6.07, 6.67, 6.97,
    6.51, 6.48, 7.44, 7.98, 6.71, 6.98, 7.60, 5.62, 7.04, 7.31, 5.08, 6.62, 6.48, 6.91, 6.44, 6.85,
    7.09, 6.20, 7.02, 7.34, 6.57, 6.42, 6.50, 6.46, 6.42, 7.09, 7.37, 6.56, 6.69,
])  # fmt: skip
# log10 of the rates: a first guess, and where they may be.
GUESS = np.array([5.45, -1.1, -6.5, 1.15, -0.45])
LEAST, MOST = [4.5, -3.0, -7.5, 0.0, -1.5], [6.5, 0.5, -6.0, 2.0, 0.5]
# Millions of cells, healthy and infected, and log10 of the load.
START = np.array([1.0, 0.0, 2.0])
_STEPS, _ROWS = 3000, 100


def hiv() -> OCP:
    r"""Five rates of an infection with HIV, from 61 measurements of the viral load.

    Healthy cells H, infected cells I, virus V, t in years:

    .. math::

        \dot H = k_1 - k_2 H - k_3 H V, \; \dot I = k_3 H V - k_4 I, \;
        \dot V = -k_3 H V - k_5 V + 100 I, \quad (H, I, V)(0) = (10^6, 0, 100)

    States are H and I in millions and log10 V, which is measured with an error of 1 throughout;
    constants are log10 k. The guess runs the model: from flat states no method finds a way.

    Optimum: 15.1601 at log10 k = (5.51, -0.91, -6.49, 1.15, -0.41), in a valley so flat that
    (5.52, -0.44, -6.68, 0.12, 0.55) is a local one at 15.377: the data do not tell the rates, and
    ``estimate`` says so by standard errors of up to two and a half decades. Problem and data:
    [GEKKO], whose values cost 31.4.
    """
    k = ca.SX.sym("k", 5)
    healthy, infected, load = (ca.SX.sym(name) for name in ("healthy", "infected", "load"))
    rate, virus = 10.0**k, 10.0**load
    new = rate[2] * healthy * virus
    growth = -1e6 * rate[2] * healthy - rate[4] + 1e8 * infected / virus
    f = ca.vertcat(
        1e-6 * rate[0] - rate[1] * healthy - new, new - rate[3] * infected, growth / np.log(10.0)
    )
    model = Model(name="infection", x=ca.vertcat(healthy, infected, load), u=ca.SX(0, 1), f=f)
    return OCP(
        name="HIV",
        model=model,
        x0=START,
        horizon=TIMES[-1],
        unknowns=(Unknown("log10 rates", k, GUESS, LEAST, MOST),),
        data=(Measurement("load", load, TIMES, LOADS),),
        guess=Guess(x=_simulated(ca.Function("rate", [model.x], [ca.substitute(f, k, GUESS)]))),
    )


def _simulated(rate: ca.Function) -> np.ndarray:
    """Return equally spaced states of the model with the guess of its rates, by RK4 steps."""
    x, h = ca.SX.sym("x", 3), TIMES[-1] / _STEPS
    after = RK4()(lambda z, _: rate(z), x, 0.0, h)
    step = ca.Function("step", [x], [after]).mapaccum(_STEPS)
    return np.vstack([START, np.array(step(START)).T[_STEPS // _ROWS - 1 :: _STEPS // _ROWS]])
