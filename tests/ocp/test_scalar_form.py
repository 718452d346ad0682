"""Problems written in MX: the same problem as in SX, whatever its terms are made of."""

import pickle
from typing import Any

import casadi as ca
import numpy as np
import pytest

from ocp import (
    OCP,
    Constraint,
    Model,
    Parameter,
    ProblemError,
    Signal,
    Table,
    Unknown,
    evaluate,
    solve,
)
from solvers import Collocation, MultipleShooting
from tests.tolerances import ROUNDING, SAME_PROGRAM

# The type hints say SX, which is what is kept.
MX: Any = ca.MX


def crane(kind: Any, **changes: Any) -> OCP:
    """Return a load that is moved, with every sort of symbol, written in SX or MX."""
    x, u, t, p = kind.sym("x", 2), kind.sym("u"), kind.sym("t"), kind.sym("p")
    gear, gust = kind.sym("gear"), kind.sym("gust")
    model = Model(name="load", x=x, u=u, t=t, f=ca.vertcat(x[1], gear * u - p * x[1] + gust))
    given: dict[str, Any] = {
        "running_cost": u**2 / 2 + ca.sin(t) * x[0] ** 2,
        "terminal_cost": gear**2,
        "constraints": (
            Constraint("arrival", x, [1, 0], [1, 0], at="terminal"),
            Constraint("speed", x[1], upper=1.8),
        ),
        "parameters": (Parameter("drag", p, 0.1), Signal("wind", gust, [0, 0.5, 0], hold="linear")),
        "unknowns": (Unknown("ratio", gear, 1.0, 0.5, 1.5),),
    }
    return OCP(name="crane", model=model, x0=[0, 0], horizon=1.0, **(given | changes))


def test_it_is_the_same_problem() -> None:
    scalars, matrices = crane(ca.SX), crane(MX)
    assert matrices.describe() == scalars.describe()
    for solver in (MultipleShooting(20), Collocation(8)):
        one, other = solve(scalars, solver), solve(matrices, solver)
        assert one.status.is_success
        assert other.cost == pytest.approx(one.cost, rel=ROUNDING)
        np.testing.assert_allclose(other.costate, one.costate, atol=1e-10)


def test_terms_may_come_later_and_from_the_model() -> None:
    x, u = MX.sym("x"), MX.sym("u")
    model = Model(name="point", x=x, u=u, f=u)
    ocp = OCP(
        name="lap",
        model=model,
        x0=[1.0],
        horizon=1.0,
        running_cost=u**2 + x**2,
        constraints=(Constraint("lap", model.x - model.start, 0, 0, at="terminal"),),
    )
    assert solve(ocp, MultipleShooting(10)).status.is_success
    copied = pickle.loads(pickle.dumps(ocp))
    assert copied.describe() == ocp.describe()


def test_states_may_be_entries_of_a_symbol() -> None:
    z = MX.sym("z", 3)
    model = Model(name="point", x=z[:2], u=z[2], f=ca.vertcat(z[1], z[2]))
    assert model.x_names == ("z_0", "z_1")
    assert model.u_names == ("z_2",)


@pytest.mark.slow
def test_what_has_no_scalar_form_is_called() -> None:
    """Solving M(q) q'' = u, a root finder and a table, in MX: as what is written out in SX."""
    x, u = MX.sym("x", 2), MX.sym("u")
    mass = ca.vertcat(ca.horzcat(2.0 + x[0], 0.3), ca.horzcat(0.3, 1.0))
    pushed = ca.solve(mass, ca.vertcat(u, x[0]))
    y, c = MX.sym("y"), MX.sym("c")
    root = ca.rootfinder("root", "newton", {"x": y, "p": c, "g": y + y**3 - c})
    knots = np.linspace(-3.0, 3.0, 61)
    table = Table(knots, knots**3, "extend")
    f = ca.vertcat(x[1], pushed[0] - root(0.0, x[1]) + 0.1 * table(x[0]))
    called = OCP(
        name="called",
        model=Model(name="called", x=x, u=u, f=f),
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=u**2,
        constraints=(Constraint("arrival", x, [1, 0], [1, 0], at="terminal"),),
    )
    a, b = ca.SX.sym("x", 2), ca.SX.sym("u")
    # y + y^3 = v, by Cardano's formula.
    half = a[1] / 2
    apart = ca.sqrt(half**2 + 1 / 27)
    cardano = _cube_root(half + apart) - _cube_root(apart - half)
    written = ca.vertcat(a[1], (b - 0.3 * a[0]) / (2.0 + a[0] - 0.09) - cardano + 0.1 * a[0] ** 3)
    plain = OCP(
        name="plain",
        model=Model(name="plain", x=a, u=b, f=written),
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=b**2,
        constraints=(Constraint("arrival", a, [1, 0], [1, 0], at="terminal"),),
    )
    for solver in (MultipleShooting(8), Collocation(3)):
        found, expected = solve(called, solver), solve(plain, solver)
        assert found.status.is_success
        assert found.cost == pytest.approx(expected.cost, rel=SAME_PROGRAM)
        assert evaluate(found).cost == pytest.approx(evaluate(expected).cost, rel=SAME_PROGRAM)


def _cube_root(value: ca.SX) -> ca.SX:
    return value ** (1 / 3)


def test_symbols_of_both_kinds_do_not_go_together() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    other = MX.sym("x")
    model, foreign = Model(name="point", x=x, u=u, f=u), Constraint("c", MX.sym("y"), 0, 1)
    with pytest.raises(ProblemError, match=r"running_cost contains x, unknown.*the x of this .*MX"):
        OCP(name="p", model=model, x0=[0.0], horizon=1.0, running_cost=other**2)
    with pytest.raises(ProblemError, match=r"'c' contains y, unknown"):
        OCP(name="p", model=model, x0=[0.0], horizon=1.0, constraints=(foreign,))
    mixed = Model(name="mixed", x=MX.sym("x"), u=u, f=MX.sym("u"))
    with pytest.raises(ProblemError, match=r"model 'mixed': f contains u, unknown.*the u of this"):
        OCP(name="p", model=mixed, x0=[0.0], horizon=1.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"x": 2 * MX.sym("x")}, r"x must be a dense column of symbols, \(2.\*x\) is an"),
        (
            {"x": MX.sym("x", 2, 2)},
            r"x must be a dense column of symbols, it has shape \(2, 2\)",
        ),
        ({"f": MX.sym("f", 2, 2)}, r"f has shape \(2, 2\)"),
        ({"f": MX.sym("f", 3)}, "f has 3 rows, but there are 1 states"),
    ],
)
def test_refuses_as_it_does_in_scalars(changes: dict[str, Any], words: str) -> None:
    x, u = MX.sym("x"), MX.sym("u")
    with pytest.raises(ProblemError, match=words):
        Model(**({"name": "m", "x": x, "u": u, "f": u} | changes))
