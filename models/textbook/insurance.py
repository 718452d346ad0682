"""An insurance contract that makes people care for their health."""

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint, Guess, Model, Unknown

# Of the illness and of what treatment does; share of illnesses; wealth; how fast utility saturates.
LOSS, DECAY, HEALTH, WEALTH, RISK = 0.2, 0.25, 1.5, 1.0, 10.0
WORST = 10.0


def insurance() -> OCP:
    r"""What an insurance should pay for an illness of each severity t, and its premium P.

    The insured spends m(t), of which I(t) is paid back, and chooses m so that spending more is
    worth nothing to him; no one else sees t.

    .. math::

        \max \int_0^{10} \big(1 - e^{-10 R} + H\big) f \, dt, \quad
        \dot I = \Big(1 - \frac{0.2 \, t \, v'(m)}{10 e^{-10 R}}\Big) h, \; \dot m = h, \quad
        P = \int_0^{10} I f \, dt

    with what is left R = 1 - P + I - m, health H = 1.5 - 0.2 t (1 - v), v(m) = m^2/(1 + m^2),
    f(t) = 0.25 e^{-0.25 t} + e^{-2.5}/10, 0 <= h <= 25, I, m between 0 and 1.5, R, H >= 0,
    10 e^{-10 R} >= 0.001, (I, m)(0) = (0, 0.001). The premium is an unknown constant, tied by an
    integral.

    Optimum: 2.0595. Problem: [Bonnans et al. 2017], after [Martinon, Picard & Raj 2018].
    """
    paid, spent, h, premium, t = (ca.SX.sym(n) for n in ("paid", "spent", "h", "premium", "t"))
    often = DECAY * ca.exp(-DECAY * t) + np.exp(-DECAY * WORST) / WORST
    cured, slope = spent**2 / (1.0 + spent**2), 2.0 * spent / (1.0 + spent**2) ** 2
    left = WEALTH - premium + paid - spent
    health = HEALTH - LOSS * t * (1.0 - cured)
    worth = RISK * ca.exp(-RISK * left)
    return OCP(
        name="insurance",
        model=Model(
            name="contract",
            x=ca.vertcat(paid, spent),
            u=h,
            f=ca.vertcat((1.0 - LOSS * t * slope / worth) * h, h),
            t=t,
        ),
        x0=[0.0, 1e-3],
        horizon=WORST,
        running_cost=-(1.0 - ca.exp(-RISK * left) + health) * often,
        control_bounds=Box(0.0, 25.0),
        state_bounds=Box(0.0, 1.5),
        unknowns=(Unknown("premium", premium, 0.3, 0.0, 1.0),),
        constraints=(
            Constraint("what is left", left, 0.0, np.log(1e4) / RISK),
            Constraint("health", health, lower=0.0),
            Constraint("premium", paid * often - premium / WORST, 0.0, 0.0, at="integral"),
        ),
        guess=Guess(x=[[0.0, 1e-3], [0.5, 0.6]], u=[0.06]),
    )
