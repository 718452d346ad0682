"""Medicine: a tumour that is starved, tuberculosis in a town."""

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint, FreeTime, Guess, Model

# Of the tumour: the size that it tends to without treatment.
LARGEST = (5.83 / 0.00873) ** 1.5
# Of the town: people, and those who are susceptible, latent, infectious, latent and infectious
# with the resistant strain, treated.
PEOPLE = 30000.0
AT_FIRST = PEOPLE / 120.0 * np.array([76.0, 36.0, 4.0, 2.0, 1.0, 1.0])


def tumour() -> OCP:
    r"""Starve a tumour with a given amount of a drug that closes its vessels.

    .. math::

        \min p(T), \quad \dot p = -0.084 \, p \ln \frac{p}{q}, \;
        \dot q = q \, (5.83 - 0.00873 \, p^{2/3} - 0.15 u), \quad
        0 \le u \le 75, \; \int_0^T u \, dt \le 15, \; T \le 5

    p is the volume of the tumour, q what its vessels feed [mm^3]; (p, q)(0) = (P/2, P/4) with
    P = (5.83/0.00873)^{3/2}, t in days.

    Optimum: 7571.67 at T = 1.196; the dose is full until it is used up, then none. Problem:
    [Betts 2010, section 6.17], after [Ledzewicz & Schattler 2007].
    """
    p, q, dose = ca.SX.sym("p"), ca.SX.sym("q"), ca.SX.sym("dose")
    growth = 5.83 - 0.00873 * p ** (2.0 / 3.0) - 0.15 * dose
    return OCP(
        name="tumour",
        model=Model(
            name="tumour",
            x=ca.vertcat(p, q),
            u=dose,
            f=ca.vertcat(-0.084 * p * ca.log(p / q), q * growth),
            x_units=("mm^3", "mm^3"),
            x_nominal=[1e4, 1e4],
        ),
        x0=[LARGEST / 2.0, LARGEST / 4.0],
        horizon=FreeTime(1.2, 0.1, 5.0),
        terminal_cost=p,
        control_bounds=Box(0.0, 75.0),
        state_bounds=Box(lower=0.1),
        constraints=(Constraint("dose", dose, upper=15.0, at="integral"),),
        guess=Guess(x=[[LARGEST / 2.0, LARGEST / 4.0], [7600.0, 300.0]], u=[12.0]),
    )


def tuberculosis() -> OCP:
    r"""Find and hold cases of tuberculosis so that few have the resistant strain, at little cost.

    Susceptible S, latent L, infectious I; M and R the same with the resistant strain; treated T; of
    N = 30000 people, t in years. With b = 13/N, c = 0.029/N, m = 0.0143:

    .. math::

        \min \int_0^5 & M + R + 25 u_1^2 + 250 u_2^2 \, dt, \qquad 0.05 \le u_i \le 0.95 \\
        \dot S &= m N - (b I + c R + m) S \\
        \dot L &= b I S - (m + 0.5 + 2 u_1 + c R) L + 0.4 (1 - u_2) I + b T I \\
        \dot I &= 0.5 L - (m + 1) I \\
        \dot M &= 0.1 (1 - u_2) I - (m + 1) M + c (S + L + T) R \\
        \dot R &= M - m R \\
        \dot T &= 2 u_1 L + (1 - 0.5 (1 - u_2)) I - (b I + c R + m) T

    Optimum: 5152.073. Problem: [Betts 2010, section 6.16], after [Jung, Lenhart & Feng 2002].
    """
    x, u = ca.SX.sym("x", 6), ca.SX.sym("u", 2)
    s, latent, sick, other, resistant, treated = ca.vertsplit(x)
    b, c, m = 13.0 / PEOPLE, 0.029 / PEOPLE, 0.0143
    lost = b * sick + c * resistant + m
    failed = (1.0 - u[1]) * sick
    f = ca.vertcat(
        m * PEOPLE - lost * s,
        b * sick * (s + treated) - (m + 0.5 + 2.0 * u[0] + c * resistant) * latent + 0.4 * failed,
        0.5 * latent - (m + 1.0) * sick,
        0.1 * failed - (m + 1.0) * other + c * (s + latent + treated) * resistant,
        other - m * resistant,
        2.0 * u[0] * latent + sick - 0.5 * failed - lost * treated,
    )
    return OCP(
        name="tuberculosis",
        model=Model(name="town", x=x, u=u, f=f, x_nominal=AT_FIRST),
        x0=AT_FIRST,
        horizon=5.0,
        running_cost=other + resistant + 25.0 * u[0] ** 2 + 250.0 * u[1] ** 2,
        control_bounds=Box(0.05, 0.95),
    )
