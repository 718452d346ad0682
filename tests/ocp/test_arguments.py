"""What is no number, no flag and no word of a list is refused by name, wherever it is given."""

# Arguments of the wrong type are what this file is about:
# pyright: reportArgumentType=false

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.textbook import van_der_pol
from ocp import RK4, FreeTime, Guess, ProblemError, evaluate, solve
from ocp.checks.arguments import (
    check_flag,
    check_not_negative,
    check_numbers,
    check_positive,
    check_real,
    check_whole,
)
from solvers import (
    GPC,
    AugmentedLagrangian,
    Batch,
    BetweenNodes,
    CertifyOptions,
    Collocation,
    IndirectShooting,
    MultipleShooting,
    ReverseShooting,
    Riccati,
    Schuetz,
    StagewiseNewton,
)

HUGE = 10**400
MASKED = np.ma.array([1.0, 2.0], mask=[False, True])
NO_NUMBERS = (
    st.text()
    | st.binary()
    | st.booleans()
    | st.complex_numbers()
    | st.none()
    | st.just(float("nan"))
    | st.integers(min_value=HUGE)
    | st.just(MASKED)
)
OPTIONS = (
    MultipleShooting(5),
    Collocation(5),
    IndirectShooting(segments=3),
    ReverseShooting(),
    StagewiseNewton(5),
    Schuetz(),
    AugmentedLagrangian(StagewiseNewton(5)),
    BetweenNodes(MultipleShooting(5)),
    Batch(),
    Riccati(),
    GPC(),
    CertifyOptions(),
    RK4(),
    FreeTime(1.0),
)


@settings(deadline=None)
@given(value=NO_NUMBERS)
@pytest.mark.parametrize("check", [check_real, check_positive, check_not_negative, check_whole])
def test_no_number(check, value):
    with pytest.raises(ProblemError, match="thing"):
        check(value, "thing")


@settings(deadline=None)
@given(value=NO_NUMBERS, place=st.integers(0, 2))
def test_no_number_among_numbers(value, place):
    if value is None:
        return  # NumPy reads None as NaN, which is refused where NaN is
    row: list[Any] = [0.0, 1, 2.5]
    row[place] = value
    for rows in (row, tuple(row)):
        with pytest.raises(ProblemError, match="thing"):
            check_numbers(rows, 3, "thing")


@pytest.mark.parametrize(
    "values", ["12", b"12", True, [True, False], MASKED, np.array(["1", "2"]), [1 + 2j, 0], HUGE]
)
def test_no_row_of_numbers(values):
    with pytest.raises(ProblemError, match="thing"):
        check_numbers(values, 2, "thing")


@given(values=st.lists(st.integers(-5, 5) | st.floats(-1e9, 1e9), min_size=3, max_size=3))
def test_numbers_of_any_kind_are_numbers(values):
    expected = np.array(values, dtype=float)
    arrays = (np.ma.array(values), np.array(values, dtype=object))
    for given_values in (values, tuple(values), np.array(values), *arrays):
        np.testing.assert_allclose(check_numbers(given_values, 3, "thing"), expected)


@pytest.mark.parametrize("value", [0, 1, "yes", None, np.nan, MASKED])
def test_no_flag(value):
    with pytest.raises(ProblemError, match="True or False"):
        check_flag(value, "thing")


@pytest.mark.parametrize("value", ["a", b"1", np.nan, -1.0, HUGE, MASKED, [1.0]], ids=repr)
@pytest.mark.parametrize("options", OPTIONS, ids=lambda o: type(o).__name__)
def test_no_option_takes_nonsense(options, value):
    # What names a part is checked where it is looked for: at build.
    for field in fields(options):
        if field.name not in ("backend", "solver"):
            with pytest.raises(ProblemError):
                replace(options, **{field.name: value})


@pytest.mark.parametrize("options", OPTIONS, ids=lambda o: type(o).__name__)
def test_no_tolerance_is_infinite(options):
    for field in fields(options):
        if field.name in ("tolerance", "complementarity", "guess", "penalty", "lower"):
            with pytest.raises(ProblemError):
                replace(options, **{field.name: np.inf})


@pytest.mark.parametrize("value", [np.nan, [0.0, np.nan], "now", None, True, MASKED, HUGE, [[0.0]]])
@pytest.mark.parametrize("solver", [MultipleShooting(5), Collocation(5)], ids=repr)
def test_no_instant(solver, value):
    found = solve(van_der_pol(), solver)
    for at in (found.control, found.state, found.costate_at):
        with pytest.raises(ProblemError, match=r"solution\.\w+: t"):
            at(value)


@pytest.mark.parametrize("value", [np.inf, np.nan, 0.0, "fine", HUGE, True])
def test_no_tolerance_of_the_referee(value):
    with pytest.raises(ProblemError, match="tolerance"):
        evaluate(solve(van_der_pol(), MultipleShooting(5)), tolerance=value)


@pytest.mark.parametrize("value", ["fast", MASKED, HUGE, [True], [b"1"], [np.nan]])
def test_no_run(value):
    program = MultipleShooting(5).build(van_der_pol())
    for given_data in ({"x0": value}, {"t0": value}, {"guess": Guess(u=value)}):
        with pytest.raises(ProblemError):
            program.run(**given_data)


def test_finite_numbers_whose_squares_are_not_are_numbers() -> None:
    np.testing.assert_array_equal(check_numbers([1e200, -1e300], 2, "these"), [1e200, -1e300])
    both = check_numbers([-np.inf, np.inf], 2, "bounds", finite=False)
    np.testing.assert_array_equal(both, [-np.inf, np.inf])
    with pytest.raises(ProblemError, match=r"these\[1\] is inf"):
        check_numbers([1e200, np.inf], 2, "these")
    with pytest.raises(ProblemError, match=r"bounds\[0\] is nan"):
        check_numbers([np.nan, np.inf], 2, "bounds", finite=False)
    solution = solve(van_der_pol(), MultipleShooting(10))
    assert solution.with_(costate=0.0 * solution.costate + 1e200).costate[0, 0] == 1e200
    with pytest.raises(ProblemError, match="costate is not finite"):
        solution.with_(costate=solution.costate + np.inf)
