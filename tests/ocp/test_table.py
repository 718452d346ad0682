"""Lookup tables: between the knots, at the ends, beyond them, and what is refused."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ocp import OCP, Model, ProblemError, Table, solve
from ocp.problem.epigraph import epigraph
from ocp.problem.scaled import sizes_of
from solvers import MultipleShooting
from tests.ocp.differences import gradient, jacobian
from tests.tolerances import DERIVATIVE, ROUNDING

KNOTS = np.linspace(0.0, 3.0, 31)
ANGLES, HEIGHTS = np.linspace(0.0, 1.0, 12), np.linspace(0.0, 2.0, 15) ** 2
ACROSS = np.sin(ANGLES)[:, None] * np.cos(HEIGHTS)


def cubic(x: np.ndarray) -> np.ndarray:
    """Return what a cubic spline gives back exactly."""
    return 1.0 - 2.0 * x + 3.0 * x**2 - x**3


def derivatives(table: Table) -> Callable[[Any], list[np.ndarray]]:
    """Return value, slope and curvature at a point (d,)."""
    x = ca.SX.sym("x", len(table.axes))
    value = table(*ca.vertsplit(x))
    curvature, slope = ca.hessian(value, x)
    function = ca.Function("f", [x], [value, slope, curvature])
    return lambda at: [np.array(each) for each in function(at)]


@given(st.integers(4, 40), st.floats(-0.5, 3.5))
def test_a_cubic_comes_back_exactly(count: int, x: float) -> None:
    knots = np.linspace(0.0, 3.0, count)
    inside = min(max(x, 0.0), 3.0)
    slope = -2.0 + 6.0 * inside - 3.0 * inside**2
    line = cubic(np.array(inside)) + (x - inside) * slope
    assert Table(knots, cubic(knots), "extend")(x) == pytest.approx(line, abs=1e-10)
    assert Table(knots, cubic(knots), "clamp")(x) == pytest.approx(cubic(np.array(inside)))
    refusing = Table(knots, cubic(knots))(x)
    if abs(inside - x) > 1e-5 or inside == x:  # between lies the margin
        assert np.isnan(refusing) == (inside != x)


@given(
    st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=20),
    st.floats(-0.5, 1.5).filter(lambda x: min(abs(x), abs(x - 1.0)) > 1e-3),
    st.sampled_from(["extend", "clamp"]),
)
def test_derivatives_agree_with_differences(values: list[float], x: float, beyond: Any) -> None:
    table = Table(np.linspace(0.0, 1.0, len(values)), values, beyond)
    at = derivatives(table)
    size = 1e3 * max(1.0, float(np.abs(at(x)[2]).max()))  # of third derivatives, at most
    slope = gradient(lambda v: float(at(v)[0][0, 0]), np.array([x]))
    np.testing.assert_allclose(at(x)[1][0], slope, atol=DERIVATIVE * size)
    bend = jacobian(lambda v: at(v)[1], np.array([x]))
    np.testing.assert_allclose(at(x)[2], bend, atol=1e-4 * size)  # it bends at every knot


@pytest.mark.parametrize("beyond", ["extend", "clamp", "refuse"])
@pytest.mark.parametrize("point", [(0.3, 1.7), (0.9, 0.1), (-0.4, 1.2), (0.5, 5.0), (1.3, 4.4)])
def test_derivatives_along_two_arguments(beyond: Any, point: tuple[float, float]) -> None:
    at = derivatives(Table((ANGLES, HEIGHTS), ACROSS, beyond))
    value, slope, curvature = at(point)
    if beyond == "refuse" and not (0.0 < point[0] < 1.0 and 0.0 < point[1] < 4.0):
        assert np.isnan(value)
        return
    expected = gradient(lambda v: float(at(v)[0][0, 0]), np.array(point))
    np.testing.assert_allclose(slope[:, 0], expected, atol=DERIVATIVE)
    expected = jacobian(lambda v: at(v)[1], np.array(point))
    np.testing.assert_allclose(curvature, expected, atol=1e-6)


def test_a_table_of_two_arguments_is_near_what_it_samples() -> None:
    table, (a, h) = Table((ANGLES, HEIGHTS), ACROSS), np.meshgrid(ANGLES, HEIGHTS, indexing="ij")
    np.testing.assert_allclose(table(a, h), ACROSS, atol=ROUNDING)
    assert table(0.31, 1.7) == pytest.approx(np.sin(0.31) * np.cos(1.7), abs=1e-4)


def test_one_of_three_arguments() -> None:
    x, y, z = np.linspace(0, 1, 4), np.linspace(0, 2, 5), np.linspace(-1, 1, 6)
    values = x[:, None, None] ** 3 + 2.0 * y[:, None] * z
    table = Table((x, y, z), values, "extend")
    assert table(0.2, 1.3, 0.4) == pytest.approx(0.2**3 + 2.0 * 1.3 * 0.4)
    assert table(2.0, 3.0, -2.0) == pytest.approx(1.0 + 3.0 * 1.0 - 12.0)


def test_extended_it_has_no_jump_of_slopes_next_to_a_corner() -> None:
    at = derivatives(Table((ANGLES, HEIGHTS), ACROSS, "extend"))
    below, above = at([1.5, 4.0 - 1e-9]), at([1.5, 4.0 + 1e-9])
    np.testing.assert_allclose(below[1], above[1], atol=1e-7)


def test_at_the_ends_derivatives_are_those_of_the_spline() -> None:
    at = derivatives(Table(KNOTS, cubic(KNOTS)))
    for end in (0.0, 3.0):
        value, slope, curvature = (float(each[0, 0]) for each in at(end))
        assert value == pytest.approx(float(cubic(np.array(end))), abs=1e-10)
        assert slope == pytest.approx(-2.0 + 6.0 * end - 3.0 * end**2, abs=1e-8)
        assert curvature == pytest.approx(6.0 - 6.0 * end, abs=1e-5)


def test_linear_between_its_knots() -> None:
    table = Table([0.0, 1.0, 3.0], [0.0, 1.0, 0.0], "extend", between="linear")
    np.testing.assert_allclose(table([-1.0, 0.5, 1.0, 2.0, 4.0]), [-1.0, 0.5, 1.0, 0.5, -0.5])


@pytest.mark.parametrize("between", ["linear", "cubic"])
def test_at_a_knot_derivatives_are_those_to_the_right_of_it(between: Any) -> None:
    """Of every order, as formulas: no memory is written that is another's, and no slope is 0."""
    knots = np.linspace(-4.0, 4.0, 9)
    x = ca.SX.sym("x")
    derived = [Table(knots, np.sin(knots), "extend", between)(x)]
    for _ in range(3):
        derived.append(ca.jacobian(derived[-1], x))
    function = ca.Function("f", [x], [ca.densify(each) for each in derived])
    for knot in knots[1:-1]:
        at, right = (np.array(function.call([v])).ravel() for v in (knot, knot + 1e-9))
        np.testing.assert_allclose(at, right, atol=1e-7)
    assert abs(float(function(1.0)[1])) > 0.05


def test_linear_in_two_arguments_its_mixed_derivative_is_exact() -> None:
    rows, columns = np.linspace(-1.0, 2.0, 5), np.array([0.0, 0.5, 2.0, 3.0])
    table = Table((rows, columns), np.outer(rows**2, np.exp(columns)), between="linear")
    for i, j in np.ndindex(4, 3):
        values = np.asarray(table.values)[i : i + 2, j : j + 2]
        size = (rows[i + 1] - rows[i]) * (columns[j + 1] - columns[j])
        middle = [rows[i : i + 2].mean(), columns[j : j + 2].mean()]
        mixed = (values[0, 0] - values[0, 1] - values[1, 0] + values[1, 1]) / size
        curvature = derivatives(table)(middle)[2]
        np.testing.assert_allclose(curvature, [[0.0, mixed], [mixed, 0.0]], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("backend", ["ipopt", "native"])
@pytest.mark.parametrize("beyond", ["refuse", "clamp", "extend"])
def test_a_start_on_a_knot_is_like_one_beside_it(beyond: Any, backend: Any) -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    knots = np.linspace(-4.0, 4.0, 9)
    force = u + Table(knots, np.sin(knots), beyond, "linear")(x[0])
    ocp = OCP(
        name="pushed",
        model=Model(name="pushed", x=x, u=u, f=ca.vertcat(x[1], force)),
        x0=[1.0, 0.0],
        horizon=2.0,
        running_cost=ca.sumsqr(x) + u**2,
        smoothness=0,
    )
    program = MultipleShooting(10, backend=backend).build(ocp)
    on, beside = (program.run(x0=[at, 0.0]).or_raise() for at in (1.0, 1.0 + 1e-9))
    assert on.cost == pytest.approx(beside.cost, rel=1e-7)


def test_takes_columns_numbers_and_both_kinds_of_symbols() -> None:
    table = Table(KNOTS, cubic(KNOTS), "extend")
    kinds: tuple[Any, ...] = (ca.SX, ca.MX)
    numbers = [0.5, 3.5]
    for kind in kinds:
        symbol = kind.sym("x", 2)
        values = ca.Function("f", [symbol], [table(symbol)])(numbers)
        np.testing.assert_allclose(np.array(values)[:, 0], table(numbers))
    assert table(1.0).shape == ()
    assert table(np.ones((2, 3))).shape == (2, 3)


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda t: pickle.loads(pickle.dumps(t))]
)
def test_copies_are_the_same_function(copied: Callable[[Table], Table]) -> None:
    table = Table((ANGLES, HEIGHTS), ACROSS, "clamp", name="drag")
    table(0.5, 0.5)
    assert copied(table)(0.3, 0.4) == table(0.3, 0.4)


@pytest.mark.parametrize(
    ("arguments", "changes", "words"),
    [
        (([0, 2, 1, 3], [0, 1, 2, 3]), {}, r"knots must increase, entry 2 \(1\) does not: sort"),
        (([0, 1, 1, 3], [0, 1, 2, 3]), {}, r"knots must increase, entry 2 \(1\)"),
        (([0, 1, np.nan, 3], [0, 1, 2, 3]), {}, "knots: entry 2 is nan"),
        (([0, 1, 2, np.inf], [0, 1, 2, 3]), {}, "knots: entry 3 is inf"),
        (([0, 1, 2, 3], [0, np.nan, 2, 3]), {}, r"values\[1\] is nan"),
        (([0, 1, 2, 3], [0, 1, 2]), {}, r"values have shape \(3,\), \(4,\) is needed"),
        (([0, 1, 2], [0, 1, 2]), {}, "knots are 3, at least 4 are needed"),
        (([0], [0]), {"between": "linear"}, "knots are 1, at least 2"),
        (([[0, 1, 2, 3]], [0, 1, 2, 3]), {}, r"knots have shape \(1, 4\)"),
        (("0123", [0, 1, 2, 3]), {}, "knots is not numeric"),
        (([0, 1, 2, 3], "0123"), {}, "values is not numeric"),
        (([0, 1, 2, 3], np.zeros((4, 4))), {}, r"values have 2 dimensions.*Table\(\(x1, x2\)"),
        ((([0, 1, 2, 3], [0, 3, 2, 4]), np.zeros((4, 4))), {}, "knots of argument 1 must increase"),
        ((([0, 1, 2, 3], [0, 1, 2, 3]), np.zeros((4, 5))), {}, r"\(4, 5\), \(4, 4\) is needed"),
        (([0, 1, 2, 3], [0, 1, 2, 3]), {"beyond": "hold"}, "beyond = 'hold' is none of refuse"),
        (([0, 1, 2, 3], [0, 1, 2, 3]), {"between": "nearest"}, "between = 'nearest' is neither"),
        (([0, 1, 2, 3], [0, 1, 2, 3]), {"name": "my table"}, "name 'my table' is none"),
        (([0, 1, 2, 3], 1.0), {}, "knots"),
    ],
)
def test_refuses(arguments: tuple, changes: dict, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        Table(*arguments, **changes)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((1.0,), "takes 2 arguments, not 1"),
        ((ca.SX.sym("x", 2), ca.SX.sym("y", 3)), "its arguments have 2 and 3 entries"),
        (("a", 1.0), "argument is not numeric"),
    ],
)
def test_refuses_arguments(arguments: tuple, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        Table((ANGLES, HEIGHTS), ACROSS, name="drag")(*arguments)


def moved_by(table: Table, **changes: Any) -> OCP:
    """Return a point pushed along, and slowed by a table of its position."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    model = Model(name="point", x=x, u=u, f=u - table(x))
    given: dict[str, Any] = {"running_cost": u**2, "terminal_cost": 10.0 * (x - 1.0) ** 2} | changes
    return OCP(name="pushed", model=model, x0=[0.5], horizon=1.0, **given)


def test_kinks_have_to_be_declared() -> None:
    table = Table(KNOTS, cubic(KNOTS), between="linear", name="lift")
    with pytest.raises(ProblemError, match=r"table 'lift' is linear.*smoothness=2 is declared"):
        moved_by(table)
    moved_by(table, smoothness=0)
    moved_by(Table(KNOTS, cubic(KNOTS)))


def test_a_start_beyond_the_ends_is_named() -> None:
    table = Table(KNOTS + 1.0, cubic(KNOTS), name="lift")
    with pytest.raises(ProblemError, match=r"dynamics f.*table lift\(0.5\) comes to its end"):
        moved_by(table)


def test_rounding_of_a_table_is_no_size() -> None:
    x, u, knots = ca.SX.sym("x", 2), ca.SX.sym("u"), np.linspace(-1.0, 3.0, 50)
    table = Table(knots, 0.1 * knots**2, "extend")

    def braked(drag: ca.SX) -> OCP:
        model = Model(name="mass", x=x, u=u, f=ca.vertcat(x[1], u - drag))
        return OCP(name="braked", model=model, x0=[0, 0], horizon=1.0, running_cost=u**2)

    called, written = braked(ca.cos(x[0]) * table(x[1])), braked(0.1 * ca.cos(x[0]) * x[1] ** 2)
    np.testing.assert_allclose(sizes_of(called).x, sizes_of(written).x, rtol=1e-3)


def test_maxima_beside_a_table_become_slacks_and_those_in_its_argument_stay() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    lift, drag = Table(KNOTS, cubic(KNOTS), "extend"), Table(KNOTS, cubic(KNOTS), "clamp")
    ocp = OCP(
        name="p",
        model=Model(name="point", x=x, u=u, f=u),
        x0=[0.5],
        horizon=1.0,
        running_cost=ca.fabs(u) + lift(x) + drag(ca.fabs(x)) + u**2,
    )
    found = epigraph(ocp)
    assert found is not None
    assert found.problem.model.nu == 2  # one for abs(u)
    assert solve(ocp, MultipleShooting(10)).status.is_success
