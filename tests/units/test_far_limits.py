"""A limit that is written far away, to mean that there is none, changes nothing."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from ocp import OCP, Box, Constraint, Model, solve
from ocp.internal import sizes_of
from solvers import Collocation, MultipleShooting

X, V, U = (ca.SX.sym(name) for name in ("x", "v", "u"))
MODEL = Model(name="mass", x=ca.vertcat(X, V), u=U, f=ca.vertcat(V, U))


def transfer(unit: float = 1.0) -> OCP:
    """Rest to rest over one unit of length in 1 s: J = 6."""
    end = Constraint("end", MODEL.x, [unit, 0.0], [unit, 0.0], at="terminal")
    return OCP(
        name="transfer",
        model=MODEL,
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=(U / unit) ** 2 / 2,
        constraints=(end,),
    )


def with_far(ocp: OCP, how: str, far: float) -> OCP:
    rows = {
        "linear": Constraint("far", U, -far, far),
        "saturating": Constraint("far", U**2 / (1 + U**2), upper=far),
        "one-sided": Constraint("far", U + V, 0.0 - far, np.inf),
        "integral": Constraint("far", U**2, upper=far, at="integral"),
    }
    if how in rows:
        return replace(ocp, constraints=(*ocp.constraints, rows[how]))
    boxes = {"controls": ("control_bounds",), "states": ("state_bounds",)}
    chosen = boxes.get(how, ("control_bounds", "state_bounds"))
    return replace(ocp, **{name: Box(-far, far) for name in chosen})


@pytest.mark.many
@pytest.mark.parametrize("far", [1e7, 1e9, 1e15])
@pytest.mark.parametrize(
    "how", ["controls", "states", "both", "linear", "saturating", "one-sided", "integral"]
)
@pytest.mark.parametrize("solver", [MultipleShooting(40), Collocation(8)], ids=repr)
def test_it_changes_nothing(solver, how, far):
    plain, ocp = transfer(), with_far(transfer(), how, far)
    assert sizes_of(ocp).x == pytest.approx(sizes_of(plain).x, rel=2)
    assert sizes_of(ocp).cost == pytest.approx(sizes_of(plain).cost, rel=2)
    found = solve(ocp, solver).or_raise()
    assert found.cost == pytest.approx(solve(plain, solver).cost, rel=1e-8)


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1e6, 1e12])
def test_far_is_far_in_every_unit(unit):
    ocp = with_far(transfer(unit), "both", 1e8 * unit)
    assert sizes_of(ocp).x == pytest.approx(sizes_of(transfer(unit)).x, rel=2)
    assert solve(ocp, Collocation(8)).or_raise().cost == pytest.approx(6.0, rel=1e-7)


def test_a_limit_that_alone_tells_the_size_is_believed():
    ocp = OCP(
        name="alone",
        model=MODEL,
        x0=[0.0, 0.0],
        horizon=1.0,
        running_cost=0 * U,
        control_bounds=Box(-1e9, 1e9),
    )
    assert sizes_of(ocp).u[0] == pytest.approx(1e9, rel=10)
