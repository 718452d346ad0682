"""Parameters and signals: what they are worth at any instant."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ocp import Parameter, ProblemError, Signal
from ocp.problem.parameters import ParameterValues
from tests.ocp.problems import integrator, lag
from tests.tolerances import ROUNDING

# What a type checker would refuse as well.
MX: Any = ca.MX.sym("m")
CUBIC: Any = "cubic"
numbers = st.floats(-10.0, 10.0)


@st.composite
def samples(draw: st.DrawFn) -> np.ndarray:
    shape = (draw(st.integers(2, 12)), draw(st.integers(1, 3)))
    return draw(hnp.arrays(float, shape, elements=numbers))


def signal(rows: np.ndarray, hold: str) -> ParameterValues:
    symbol = ca.SX.sym("r", rows.shape[1])
    return ParameterValues.of([Signal("r", symbol, rows, hold=hold)], None)  # type: ignore[arg-type]


@given(samples())
def test_a_held_signal_has_two_values_at_a_jump(rows: np.ndarray) -> None:
    values = signal(rows, "held")
    n = len(rows) - 1
    nodes = np.arange(n + 1) / n
    np.testing.assert_array_equal(values.at(nodes, 1), rows)
    np.testing.assert_array_equal(values.at(nodes[1:], -1), rows[:-1])
    np.testing.assert_array_equal(values.at(0.0, -1)[0], rows[0])
    middle = (nodes[1:] + nodes[:-1]) / 2
    for side in (-1, 1):
        np.testing.assert_array_equal(values.at(middle, side), rows[:-1])


@given(samples(), st.integers(1, 4))
def test_a_held_signal_is_constant_on_each_interval_of_a_finer_grid(
    rows: np.ndarray, finer: int
) -> None:
    n = len(rows) - 1
    left, right = signal(rows, "held").on(np.linspace(0.0, 1.0, n * finer + 1))
    np.testing.assert_array_equal(left, right)
    np.testing.assert_array_equal(left, np.repeat(rows[:-1], finer, axis=0))


@given(samples(), numbers, numbers)
def test_a_linear_signal_is_exact_for_a_line(rows: np.ndarray, slope: float, start: float) -> None:
    nodes = np.linspace(0.0, 1.0, len(rows))
    line = start + slope * nodes[:, None]
    where = np.linspace(0.0, 1.0, 23)
    got = signal(line, "linear").at(where)
    np.testing.assert_allclose(got, start + slope * where[:, None], atol=1e2 * ROUNDING)


@given(samples())
def test_a_linear_signal_meets_its_samples_from_both_sides(rows: np.ndarray) -> None:
    values, nodes = signal(rows, "linear"), np.linspace(0.0, 1.0, len(rows))
    for side in (-1, 1):
        np.testing.assert_allclose(values.at(nodes, side), rows, atol=1e2 * ROUNDING)


def test_values_are_stacked_in_the_order_of_declaration() -> None:
    a, b = ca.SX.sym("a", 2), ca.SX.sym("b")
    entries = [Parameter("a", a, [1.0, 2.0]), Signal("b", b, [3.0, 4.0, 5.0])]
    values = ParameterValues.of(entries, {"a": 7.0})
    np.testing.assert_array_equal(values.at([0.0, 0.6]), [[7.0, 7.0, 3.0], [7.0, 7.0, 4.0]])
    np.testing.assert_array_equal(values.knots, [0.0, 0.5, 1.0])
    assert list(values.as_dict()) == ["a", "b"]
    longer = ParameterValues.of(entries, {"b": np.zeros(5)})
    np.testing.assert_array_equal(longer.knots, [0.0, 0.25, 0.5, 0.75, 1.0])


def test_no_parameters_make_an_empty_row_per_instant() -> None:
    assert ParameterValues.of([], None).at([0.0, 0.5, 1.0]).shape == (3, 0)


def test_values_cannot_be_changed_behind_the_problem() -> None:
    given_samples = np.zeros((3, 1))
    entry = Signal("r", ca.SX.sym("r"), given_samples)
    given_samples[:] = 1.0
    assert not entry.value.any()
    with pytest.raises(ValueError, match="read-only"):
        entry.value[0] = 1.0


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda s: Parameter("p", s, [1.0]), "parameter 'p' has 1 entries, 2 are needed"),
        (lambda s: Parameter("p", s, [1.0, np.nan]), r"parameter 'p'\[1\] is nan"),
        (lambda s: Parameter("p", s, [1.0, np.inf]), r"parameter 'p'\[1\] is inf"),
        (lambda s: Parameter("p", 2 * s, 1.0), "parameter 'p' must be a dense column"),
        (lambda s: Parameter("p", 2 * MX, 1.0), "dense column of symbols"),
        (lambda s: Parameter("p", s, "one"), "parameter 'p' is not numeric"),
        (lambda s: Signal("r", s, np.zeros((5, 3))), r"signal 'r': samples have shape \(5, 3\)"),
        (lambda s: Signal("r", s, np.zeros((1, 2))), r"shape \(1, 2\), \(N \+ 1, 2\) is needed"),
        (lambda s: Signal("r", s, np.zeros(4)), r"shape \(4, 1\)"),
        (lambda s: Signal("r", s, np.zeros((2, 2, 2))), r"shape \(2, 2, 2\)"),
        (lambda s: Signal("r", s, [[0, 0], [0, np.nan]]), "signal 'r': sample 1 is not finite"),
        (lambda s: Signal("r", s, np.zeros((4, 2)), hold=CUBIC), "hold = 'cubic'"),
        (lambda s: Signal("r", s, [[1.0, 2.0], [3.0]]), "signal 'r'"),
        (lambda s: Signal("r", s, "ramp"), "signal 'r'"),
        (lambda s: Signal("r", 2 * MX, [0.0, 1.0]), "dense column of symbols"),
    ],
)
def test_refuses(build, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        build(ca.SX.sym("s", 2))


def test_refuses_names_that_are_not_declared() -> None:
    with pytest.raises(ProblemError, match="unknown parameters: mass; declared are: none"):
        integrator().parameter_values({"mass": 1.0})


def test_names_that_are_no_text_are_refused_alike() -> None:
    given: Any = {1: 2.0, None: 3.0}
    with pytest.raises(ProblemError, match="unknown parameters: 1, None; declared are: none"):
        integrator().parameter_values(given)


def test_a_signal_of_a_discrete_problem_has_a_sample_per_node() -> None:
    r = ca.SX.sym("r")
    ocp = lag(parameters=(Signal("r", r, np.zeros(5)),))
    with pytest.raises(ProblemError, match=r"signal 'r' has 4 samples; .*4 steps needs 5"):
        ocp.parameter_values({"r": np.zeros(4)})
    with pytest.raises(ProblemError, match="signal 'r' has 7 samples"):
        lag(parameters=(Signal("r", r, np.zeros(7)),))
