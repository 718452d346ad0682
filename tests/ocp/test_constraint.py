"""Boxes and constraints."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ocp import Box, Constraint, ProblemError

finite = st.floats(-1e6, 1e6)


@st.composite
def boxes_and_values(draw: st.DrawFn) -> tuple[Box, np.ndarray]:
    """Return a box of 1 to 4 components, some without bounds, and a few points."""
    n = draw(st.integers(1, 4))
    a, b = (draw(hnp.arrays(float, n, elements=finite)) for _ in range(2))
    lower = np.where(draw(hnp.arrays(bool, n)), -np.inf, np.minimum(a, b))
    upper = np.where(draw(hnp.arrays(bool, n)), np.inf, np.maximum(a, b))
    rows = draw(st.integers(1, 5))
    return Box(lower, upper).sized(n, "box"), draw(hnp.arrays(float, (rows, n), elements=finite))


@given(boxes_and_values())
def test_a_box_contains_what_exceeds_it_nowhere(case: tuple[Box, np.ndarray]) -> None:
    box, values = case
    assert box.contains(values) == (not box.excess(values).any())
    assert box.contains(box.clip(values))
    values[-1, 0] = np.nan
    assert not box.contains(values)


@given(boxes_and_values())
def test_clip_is_the_nearest_point_and_excess_its_distance(case: tuple[Box, np.ndarray]) -> None:
    box, values = case
    clipped = box.clip(values)
    assert not box.excess(clipped).any()
    np.testing.assert_array_equal(box.clip(clipped), clipped)
    np.testing.assert_array_equal(box.excess(values), np.abs(values - clipped))


@given(boxes_and_values())
def test_an_expression_is_clipped_as_numbers_are(case: tuple[Box, np.ndarray]) -> None:
    box, values = case
    kinds: list[Any] = [ca.SX, ca.MX]
    for symbols in (kind.sym("v", values.shape[1]) for kind in kinds):
        clip = ca.Function("clip", [symbols], [box.clip_expression(symbols)])
        for value in values:
            np.testing.assert_array_equal(np.array(clip(value)).ravel(), box.clip(value))


def test_an_expression_without_bounds_is_itself() -> None:
    v = ca.SX.sym("v", 3)
    assert ca.is_equal(Box().clip_expression(v), v)
    assert ca.is_equal(Box([-np.inf, 0.0, -np.inf]).clip_expression(v)[::2], v[::2])


@given(st.integers(1, 6), finite)
def test_one_number_holds_for_every_component(n: int, number: float) -> None:
    box = Box(number).sized(n, "box")
    np.testing.assert_array_equal(box.lower, np.full(n, number))
    np.testing.assert_array_equal(box.upper, np.full(n, np.inf))
    assert box.is_active


def test_a_box_without_bounds_is_not_active() -> None:
    assert not Box().sized(3, "box").is_active
    assert Box([-np.inf, -np.inf], [np.inf, 1.0]).sized(2, "box").is_active


@pytest.mark.parametrize(
    ("lower", "upper", "message"),
    [
        ([0.0, 2.0], [1.0, 1.0], r"box\[1\]: no number lies between 2.0 and 1.0"),
        (np.inf, np.inf, r"box\[0\]: no number"),
        (-np.inf, -np.inf, r"box\[0\]: no number"),
        ([0.0, 0.0, 0.0], 1.0, "box: lower has 3 entries, 2 are needed"),
        (0.0, [1.0], "box: upper has 1 entries, 2 are needed"),
        ([0.0, np.nan], 1.0, r"box: lower\[1\] is nan"),
        ([-np.inf, np.nan], 1.0, r"box: lower\[1\] is nan"),
        ("low", 1.0, "box: lower is not numeric"),
    ],
)
def test_box_refuses(lower: object, upper: object, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        Box(lower, upper).sized(2, "box")  # type: ignore[arg-type]


def test_constraint_stacks_its_rows_and_sizes_its_bounds() -> None:
    x = ca.SX.sym("x", 3)
    c = Constraint("c", [x[0], x[1] + x[2]], upper=1.0)  # type: ignore[arg-type]
    assert c.size == 2
    np.testing.assert_array_equal(c.lower, [-np.inf, -np.inf])
    np.testing.assert_array_equal(c.box.upper, [1.0, 1.0])
    assert not c.is_equation
    assert Constraint("e", x, 0.0, 0.0).is_equation
    assert not Constraint("mixed", x, 0.0, [0.0, 0.0, 1.0]).is_equation


@pytest.mark.parametrize(
    ("expression", "bounds", "at", "message"),
    [
        (
            ca.SX.sym("x"),
            (0.0, 1.0),
            "somewhere",
            "at = 'somewhere' is no place; 'path', 'initial', 'terminal', 'integral', "
            "'instants' are",
        ),
        (ca.MX.sym("x", 2, 2), (0.0, 1.0), "path", r"constraint 'c' has shape \(2, 2\)"),
        (ca.SX.sym("x", 2, 2), (0.0, 1.0), "path", r"constraint 'c' has shape \(2, 2\)"),
        (ca.SX.sym("x"), (1.0, 0.0), "path", r"constraint 'c'\[0\]: no number"),
        (ca.SX.sym("x"), ([0.0, 0.0], 1.0), "path", "constraint 'c': lower has 2"),
        (ca.SX.sym("x"), (np.nan, 1.0), "path", "constraint 'c': lower"),
        (ca.SX.sym("x"), (0.0, np.nan), "path", "constraint 'c': upper"),
        ("x > 0", (0.0, 1.0), "path", "constraint 'c' is a str"),
        (ca.SX.sym("x") <= 1.0, (0.0, 1.0), "path", r"'c': \(x<=1\) is true or false"),
        ([ca.SX.sym("x"), ca.SX.sym("y") == 0.0], (0.0, 1.0), "path", r"\(y==0\) is true or"),
    ],
)
def test_constraint_refuses(expression: object, bounds: tuple, at: str, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        Constraint("c", expression, *bounds, at=at)  # type: ignore[arg-type]


def test_what_is_no_number_is_outside_every_box() -> None:
    assert Box(-1.0, 1.0).sized(2, "v").excess(np.array([[0.0, np.nan]])).tolist() == [
        [0.0, np.inf]
    ]
