"""Chemical reactors: two catalysts along a tube or in time, two reactions side by side."""

import casadi as ca

from ocp import OCP, Box, Model


def catalyst_mixing() -> OCP:
    r"""Mix two catalysts along a tube so that most of the third substance leaves it.

    .. math::

        \min x_1(1) + x_2(1) - 1, \quad \dot x_1 = u (10 x_2 - x_1), \;
        \dot x_2 = u (x_1 - 10 x_2) - (1 - u) x_2, \; 0 \le u \le 1, \quad x(0) = (1, 0)

    Optimum: -0.0480557; bang, singular, bang: u = 1 until 0.1363, 0.2271 on the singular arc, 0
    from 0.7252 on. The problem is linear in x at a given u: only the ratio x_2/x_1 matters, a
    singular arc rests at one ratio, so u is constant on it, and the cost follows from the
    exponentials of three matrices, least over the two switches and that u. Problem:
    [Dolan, More & Munson 2004].
    """
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    first = u * (10.0 * x[1] - x[0])
    return OCP(
        name="catalyst mixing",
        model=Model(name="tube", x=x, u=u, f=ca.vertcat(first, -first - (1.0 - u) * x[1])),
        x0=[1.0, 0.0],
        horizon=1.0,
        terminal_cost=x[0] + x[1] - 1.0,
        control_bounds=Box(0.0, 1.0),
    )


def two_catalysts() -> OCP:
    r"""The same chain of reactions in a longer tube (Jackson's problem).

    .. math::

        \min -c(4), \quad \dot a = -u (a - 10 b), \; \dot b = u (a - 10 b) - (1 - u) b, \;
        \dot c = (1 - u) b, \; 0 \le u \le 1, \quad (a, b, c)(0) = (1, 0, 0)

    Optimum: -0.1918144; bang, singular, bang as in ``catalyst_mixing``, with the same singular
    control and the same first and last arcs. Problem: [Jackson 1968].
    """
    a, b, c, u = (ca.SX.sym(name) for name in ("a", "b", "c", "u"))
    forth = u * (a - 10.0 * b)
    back = (1.0 - u) * b
    return OCP(
        name="two catalysts",
        model=Model(
            name="long tube", x=ca.vertcat(a, b, c), u=u, f=ca.vertcat(-forth, forth - back, back)
        ),
        x0=[1.0, 0.0, 0.0],
        horizon=4.0,
        terminal_cost=-c,
        control_bounds=Box(0.0, 1.0),
    )


def parallel_reactions() -> OCP:
    r"""Heat a reactor so that most of the first substance becomes the wanted one.

    .. math::

        \min -b(1), \quad \dot a = -(u + u^2/2) a, \; \dot b = u a, \; 0 \le u \le 5, \quad
        (a, b)(0) = (1, 0)

    Optimum: -0.5735451; u grows, and meets its bound near the end. Problem: [Bachmann et al. 2012].
    """
    a, b, u = (ca.SX.sym(name) for name in ("a", "b", "u"))
    return OCP(
        name="parallel reactions",
        model=Model(
            name="batch", x=ca.vertcat(a, b), u=u, f=ca.vertcat(-(u + u**2 / 2.0) * a, u * a)
        ),
        x0=[1.0, 0.0],
        horizon=1.0,
        terminal_cost=-b,
        control_bounds=Box(0.0, 5.0),
    )
