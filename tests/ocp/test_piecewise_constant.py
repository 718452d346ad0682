"""Decisions in expressions: constant where they do not jump, and seen as what they are."""

import casadi as ca
import numpy as np
import pytest

from ocp.internal import deciding, piecewise_constant
from tests.ocp.differences import jacobian
from tests.tolerances import DERIVATIVE


def decision(kind: type) -> ca.Function:
    """(x, 2) -> 3 or -2, by which is larger, and the whole part of the first."""
    x = kind.sym("x", 2)
    return piecewise_constant(
        "larger", x, ca.vertcat(ca.if_else(x[0] > x[1], 3.0, -2.0), ca.floor(x[0]))
    )


@pytest.mark.parametrize("kind", [ca.SX, ca.MX])
@pytest.mark.parametrize("at", [(1.3, 0.4), (0.2, 1.7)])
def test_derivatives_of_what_is_made_of_it(kind: type, at: tuple[float, float]) -> None:
    """Value, gradient and Hessian; and the same of an expression that is called in turn."""
    y = ca.SX.sym("y", 2)
    sign, whole = ca.vertsplit(decision(kind)(2.0 * y))
    expression = sign * y[0] ** 2 * y[1] + whole * y[1]
    hessian, gradient = ca.hessian(expression, y)
    function = ca.Function("f", [y], [expression, gradient, hessian])
    _, slope, bend = (np.array(value) for value in function(at))
    found = jacobian(lambda v: np.array(function(v)[0]), np.array(at))
    np.testing.assert_allclose(slope.ravel(), found.ravel(), atol=DERIVATIVE)
    bends = jacobian(lambda v: np.array(function(v)[1]), np.array(at))
    np.testing.assert_allclose(bend, bends, atol=DERIVATIVE)
    z = ca.MX.sym("z", 2)
    again = ca.Function("g", [z], [ca.hessian(function(z)[0], z)[0]])
    np.testing.assert_allclose(np.array(again(at)), bends, atol=DERIVATIVE)


def test_it_is_recognised() -> None:
    x = ca.SX.sym("x", 2)
    chosen = decision(ca.SX)(x)[0]
    found = deciding(chosen)
    assert found is not None
    assert found.name() == "larger"
    other = ca.Function("other", [x], [ca.sumsqr(x)], {"never_inline": True})
    for node in (x[0], ca.sin(x[0]), ca.SX(1.0), other(x)):
        assert deciding(node) is None
