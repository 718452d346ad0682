"""Checks of what a user gives: one number, a whole number, an instance."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ocp import Box, ProblemError
from ocp.checks.arguments import check_instance, check_not_negative, check_positive, check_whole

NO_NUMBERS = ["1", None, True, np.nan, 1j, [1.0], np.ones(1), np.bool_(True), float]


@pytest.mark.parametrize("value", [*NO_NUMBERS, -1.0, -np.inf, np.int64(-1), np.inf])
@pytest.mark.parametrize("check", [check_positive, check_not_negative])
def test_what_is_no_such_number_is_named(check, value) -> None:
    with pytest.raises(ProblemError, match=r"^length = .* must be (positive|0 or more), finite$"):
        check(value, "length")


@given(st.one_of(st.floats(1e-300, 1e300), st.integers(1, 10**300)))
def test_a_number_comes_back_as_a_float(value: float) -> None:
    for check in (check_positive, check_not_negative):
        found = check(value, "length")
        assert type(found) is float
        assert found == float(value)


@pytest.mark.parametrize("zero", [0, 0.0, -0.0, np.float32(0.0), np.int8(0)])
def test_zero_is_not_negative_and_not_positive(zero) -> None:
    assert check_not_negative(zero, "length") == 0.0
    with pytest.raises(ProblemError, match="it must be positive, finite"):
        check_positive(zero, "length")


@pytest.mark.parametrize("check", [check_positive, check_not_negative])
def test_limits(check) -> None:
    assert check(np.inf, "length", finite=False) == np.inf
    assert check(0.5, "share", below=1.0) == 0.5
    for value in (1.0, 2, np.inf, np.nan):
        with pytest.raises(ProblemError, match=r"it must be (positive|0 or more), below 1$"):
            check(value, "share", below=1.0)
    with pytest.raises(ProblemError, match=r"it must be (positive|0 or more)$"):
        check(np.nan, "length", finite=False)


@pytest.mark.parametrize("value", [*NO_NUMBERS, 1.0, 0, -3, np.int64(0)])
def test_what_is_no_whole_number_is_named(value) -> None:
    with pytest.raises(ProblemError, match=r"^steps must be a whole number of at least 1, not "):
        check_whole(value, "steps")


def test_an_instance_and_what_was_meant() -> None:
    check_instance(Box(), Box, "bounds")
    check_instance(3, (int, float), "number")
    with pytest.raises(ProblemError, match="bounds is the class Box, Box is needed: write Box"):
        check_instance(Box, Box, "bounds")
    with pytest.raises(ProblemError, match=r"number is a str, int or float is needed$"):
        check_instance("3", (int, float), "number")
