"""What a person reads."""

import casadi as ca
import pytest

from ocp import OCP, Box, Constraint, FreeTime, Model
from tests.ocp.problems import energy, integrator, lag, pendulum


def test_continuous_time() -> None:
    text = pendulum().describe()
    assert "pendulum   (pendulum: 2 states, 2 controls)" in text
    assert "minimise    phi(x(1.5), 1.5) + int 0..1.5 L dt" in text
    assert "d(x_0)/dt = (x_1+(0.1*u_1))" in text
    assert "x(0) = (0.7, -0.2)" in text
    assert "gain (gain): parameter, (0.8)" in text
    assert "held (held): signal, (0.5, -0.5, 1, 0.3)" in text


@pytest.mark.parametrize("steps", [1, 3, 4, 6, 7, 49])
def test_discrete_time_counts_its_steps(steps: int) -> None:
    text = lag(horizon=steps).describe()
    assert f"sum k=0..{steps - 1} of L" in text
    assert "x[k+1] = ((0.5*x)+u)" in text


def test_free_time() -> None:
    text = integrator(horizon=FreeTime(guess=1.0, lower=0.5)).describe()
    assert "phi(x(T), T) + int 0..T L dt" in text
    assert "0.5 <= T s, free" in text


def test_bounds_constraints_and_invariants() -> None:
    x, u = ca.SX.sym("q", 2), ca.SX.sym("u")
    ocp = OCP(
        name="all",
        model=Model(name="m", x=x, u=u, f=ca.vertcat(x[1], u), x_units=("m", "m/s")),
        x0=[0.0, 0.0],
        horizon=1.0,
        state_bounds=Box([-1.0, -float("inf")], 2.0),
        control_bounds=Box(-float("inf"), 3.0),
        constraints=(
            Constraint("speed", x[1] * u, 0.0, 4.0),
            Constraint("start", x[0], 0.0, 0.0, at="initial"),
        ),
        invariants=(Constraint("spin", x[0] - x[0], 0.0, 0.0),),
    )
    text = ocp.describe()
    assert "-1 <= q_0 <= 2 m" in text
    assert "q_1 <= 2 m/s" in text
    assert "u <= 3" in text
    assert "0 <= (q_1*u) <= 4   (speed, path)" in text
    assert "q_0 = 0   (start, initial)" in text
    assert "(spin, kept by the dynamics)" in text
    assert "x(0) = (0, 0)   (guess)" in text


def test_a_number_that_occurs_twice_is_no_reason_to_hide_an_expression() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    f = u + 2 * (1 - (x / 50 - 1) ** 2)
    assert "@1=1" in str(f)
    model = Model(name="river", x=x, u=u, f=f)
    text = OCP(name="river", model=model, x0=[0.0], horizon=1.0, running_cost=u**2).describe()
    assert "river   (river: 1 state, 1 control)" in text
    assert "d(x)/dt = (u+(2.*(1-sq(((x/50)-1)))))" in text


def test_terminal_equations() -> None:
    text = energy().describe()
    assert "x_0 = 1   (end, terminal)" in text
    assert "x_1 = 0   (end, terminal)" in text


def test_a_long_expression_says_what_it_depends_on() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    long = x
    for _ in range(40):
        long = ca.sin(long) * u + x
    model = Model(name="m", x=x, u=u, f=long)
    text = OCP(name="long", model=model, x0=0.0, horizon=1.0).describe()
    assert "nodes] of (x, u)" in text or "nodes] of (u, x)" in text
    assert max(map(len, text.splitlines())) < 120
