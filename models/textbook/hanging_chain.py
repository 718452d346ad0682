"""The hanging chain: least potential energy at a given length."""

import casadi as ca
import numpy as np

from models.textbook.ends import ends_at
from ocp import OCP, Guess, Model


def hanging_chain() -> OCP:
    r"""Hang a chain of length 4 between (0, 1) and (1, 3) with least potential energy.

    .. math::

        \min \int_0^1 x \sqrt{1 + u^2} \, dt, \quad \dot x = u, \;
        \dot\ell = \sqrt{1 + u^2}, \quad (x, \ell): (1, 0) \to (3, 4)

    Optimum: 5.0684801. A catenary x = c cosh((t - b)/c) - μ, since the Hamiltonian
    (x + μ)/√(1 + u²) is constant. √(4² - 2²) = 2c sinh(1/(2c)) gives c; tanh((1/2 - b)/c) = 2/4
    gives b; x(0) = 1 gives μ; the energy is the integral of c cosh² - μ cosh. Problem:
    [Dolan, More & Munson 2004].
    """
    height, length, slope = ca.SX.sym("height"), ca.SX.sym("length"), ca.SX.sym("slope")
    stretch = ca.sqrt(1.0 + slope**2)
    t = np.linspace(0.0, 1.0, 41)
    sag = np.stack([1.0 + 8.0 * t * (t / 2.0 - 0.25), 4.0 * t], axis=1)
    return OCP(
        name="hanging chain",
        model=Model(
            name="chain",
            x=ca.vertcat(height, length),
            u=slope,
            f=ca.vertcat(slope, stretch),
        ),
        x0=[1.0, 0.0],
        horizon=1.0,
        running_cost=height * stretch,
        constraints=ends_at(ca.vertcat(height, length), [3.0, 4.0]),
        guess=Guess(x=sag, u=(8.0 * (t - 0.25))[:, None]),
    )
