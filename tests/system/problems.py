"""Solvers of every kind, each with a problem that it solves quickly."""

import casadi as ca

from models.textbook import van_der_pol
from ocp import OCP, Box, Model, Solver
from solvers import (
    AugmentedLagrangian,
    Axis,
    Batch,
    BetweenNodes,
    Collocation,
    Greedy,
    GridDP,
    IndirectShooting,
    LinearMPC,
    MultipleShooting,
    ReverseShooting,
    Riccati,
    Schuetz,
    StagewiseNewton,
)
from tests.mpc.problems import cart
from tests.ocp.problems import lag, pendulum
from tests.solvers.test_reverse_shooting import bare


def braking(**changes) -> OCP:
    """A cart with bounded force and nothing else."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    given = {
        "name": "braking",
        "model": Model(name="cart", x=x, u=u, f=ca.vertcat(x[1], u)),
        "x0": [1.0, 0.0],
        "horizon": 2.0,
        "running_cost": ca.sumsqr(x) + u**2,
        "control_bounds": Box(-2.0, 2.0),
    }
    return OCP(**(given | changes))


def in_micrometres() -> OCP:
    """The same far from any natural size: solvers measure it in sizes of its own."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    return braking(
        model=Model(name="cart", x=x, u=u, f=ca.vertcat(x[1], 1e6 * u)),
        x0=[1e6, 0.0],
        running_cost=ca.sumsqr(x / 1e6) + u**2,
    )


def with_a_kink() -> OCP:
    """The control costs its absolute value, for which solvers take a slack control."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    model = Model(name="cart", x=x, u=u, f=ca.vertcat(x[1], u))
    cost = ca.sumsqr(x) + ca.fabs(u) + 0.1 * u**2
    return braking(name="kink", model=model, running_cost=cost, smoothness=0)


EVERY: tuple[tuple[Solver, OCP], ...] = (
    (MultipleShooting(10), cart()),
    (MultipleShooting(10), in_micrometres()),
    (MultipleShooting(10), with_a_kink()),
    (MultipleShooting(12, backend="fatrop"), pendulum()),
    (MultipleShooting(12, backend="native"), pendulum()),
    (MultipleShooting(10, backend="fatrop", time_limit=20.0), cart()),
    (Collocation(5), cart()),
    (BetweenNodes(MultipleShooting(10)), cart()),
    (StagewiseNewton(20), pendulum()),
    (Schuetz.sound(), braking()),
    (IndirectShooting(segments=5), van_der_pol()),
    (ReverseShooting(), bare(free_start=True)),
    (AugmentedLagrangian(Schuetz.sound()), cart()),
    (Riccati(), lag()),
    (Batch(), lag()),
    (LinearMPC(), lag()),
    (Greedy(10), braking()),
    (GridDP((Axis(-2.0, 2.0, 41),), controls=(Axis(-1.0, 1.0, 21),)), lag()),
)
