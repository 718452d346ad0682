"""Min-max problems: the largest value along the way is to be as small as can be."""

import casadi as ca

from models.textbook.ends import ends_at
from ocp import OCP, Constraint, Guess, Model, Peak


def least_jerk() -> OCP:
    r"""Move a lift by 1 in time 1, from rest to rest, with the smallest largest jerk.

    .. math::

        \min \max_t |u|, \quad \dddot x = u, \quad
        (x, \dot x, \ddot x): (0, 0, 0) \to (1, 0, 0)

    Optimum: 32. With a given bound j the fastest transfer has the jerk j, -j, j, for a quarter, a
    half and a quarter of the time T, and T^3 = 32/j; the least bound for T = 1 is its inverse.
    """
    x, jerk = ca.SX.sym("x", 3), ca.SX.sym("jerk")
    return OCP(
        name="least jerk",
        model=Model(name="lift", x=x, u=jerk, f=ca.vertcat(x[1], x[2], jerk)),
        x0=[0.0, 0.0, 0.0],
        horizon=1.0,
        peaks=(Peak("jerk", ca.fabs(jerk)),),
        constraints=ends_at(x, [1.0, 0.0, 0.0]),
    )


def least_excursion(effort: float = 4.0) -> OCP:
    r"""Turn a mass round within a budget of effort, so that it goes as little away as can be.

    .. math::

        \min \max_t x, \quad \ddot x = u, \; \int_0^1 \frac{u^2}{2} dt \le E, \quad
        (x, \dot x): (0, 1) \to (0, -1)

    Optimum: 4/(9 E), if E is 8/3 at least. It is ``bryson_denham`` with cost and wall exchanged:
    there the least effort before a wall at l is 4/(9 l), which falls as l grows.

    Args:
        effort: the budget E.
    """
    x, v, u = ca.SX.sym("x"), ca.SX.sym("v"), ca.SX.sym("u")
    state = ca.vertcat(x, v)
    return OCP(
        name="least excursion",
        model=Model(name="mass", x=state, u=u, f=ca.vertcat(v, u)),
        x0=[0.0, 1.0],
        horizon=1.0,
        peaks=(Peak("excursion", x),),
        constraints=(
            *ends_at(state, [0.0, -1.0]),
            Constraint("effort", u**2 / 2.0, upper=effort, at="integral"),
        ),
        guess=Guess(x=[[0.0, 1.0], [0.1, 0.0], [0.0, -1.0]], u=[-2.0]),
    )
