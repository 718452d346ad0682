"""A problem without its constraints: their augmented Lagrangian is part of the cost."""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp import OCP, Box, Parameter, Signal
from solvers.constrained.standard_form import StandardForm

MULTIPLIER, END_MULTIPLIER = "multiplier of the path", "multiplier of the end"
PENALTY, SCALE = "penalty", "scale"


@dataclass(frozen=True, eq=False)
class RelaxedProblem:
    r"""The augmented Lagrangian of a problem, as a problem of its own.

    .. math::

        \min \; \sigma \Bigl( \varphi + P(\psi, \nu, \rho)
        + \int L + P\bigl(c(x, u, t), \mu(t), \rho\bigr) \, dt \Bigr), \qquad
        P(c, \mu, \rho) = \sum_i \frac{\max(0, \mu_i + \rho c_i)^2 - \mu_i^2}{2 \rho}

    and for an equation μ c + ρ c²/2. Path constraints, state bounds and terminal constraints
    are relaxed; control bounds, initial constraints and a free final time stay. P is once
    continuously differentiable in c, so the problem is no smoother than that. The scale σ
    changes no minimiser, but what the tolerances of a solver mean: where P outgrows the cost
    they would be out of reach without it.

    Source: [Hestenes 1969], [Rockafellar 1974], [Hager 1990].

    Attributes:
        ocp: the relaxed problem, with μ (a signal, linear between its samples), ν, ρ and σ as
            parameters: it is built once and run with many of them.
        path: the rows along the way.
        end: the rows at the end, with those along the way that no control decides.
    """

    ocp: OCP
    path: StandardForm
    end: StandardForm

    @classmethod
    def of(cls, ocp: OCP, intervals: int) -> "RelaxedProblem":
        """Relax a problem, its multipliers sampled at the ends of ``intervals``."""
        path, end = StandardForm.along(ocp), StandardForm.at_end(ocp)
        mu, nu = ca.SX.sym("mu", path.size), ca.SX.sym("nu", end.size)
        rho, sigma = ca.SX.sym("rho"), ca.SX.sym("sigma")
        hold = "held" if ocp.model.is_discrete else "linear"
        added: list[Parameter | Signal] = [
            Parameter(PENALTY, rho, 1.0),
            Parameter(SCALE, sigma, 1.0),
        ]
        if path.size:
            added += [Signal(MULTIPLIER, mu, np.zeros((intervals + 1, path.size)), hold=hold)]
        if end.size:
            added += [Parameter(END_MULTIPLIER, nu, np.zeros(end.size))]
        relaxed = replace(
            ocp,
            name=f"{ocp.name}, constraints relaxed",
            running_cost=sigma * (ocp.running_cost + _augmented(path, mu, rho)),
            terminal_cost=sigma * (ocp.terminal_cost + _augmented(end, nu, rho)),
            state_bounds=Box(),
            constraints=ocp.at("initial"),
            parameters=(*ocp.parameters, *added),
            smoothness=min(ocp.smoothness, 1),
        )
        return cls(relaxed, path, end)


def _augmented(rows: StandardForm, multiplier: ca.SX, penalty: ca.SX) -> ca.SX:
    pushed = multiplier + penalty * rows.c
    for i in np.flatnonzero(~rows.is_equation):
        pushed[int(i)] = ca.fmax(0.0, pushed[int(i)])
    # For an equation the same expression, without the max, is mu c + rho c^2 / 2.
    return (ca.sumsqr(pushed) - ca.sumsqr(multiplier)) / (2.0 * penalty)
