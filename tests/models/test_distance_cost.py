"""The distance cost: its formula (thesis 3.48), its gradient, its two combinations."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models import Combine, Disc, DistanceCost, PlanarArm, link_distances
from ocp import ProblemError

ARM = PlanarArm((1.0, 1.0, 1.0))
DISCS = (Disc([0.4, 1.3], 0.1), Disc([1.5, 0.2], 0.2))
THETA = ca.SX.sym("theta", 3)


def cost_function(combine: Combine) -> ca.Function:
    p0 = DistanceCost(100.0, 0.8, combine).of(ARM, THETA, DISCS)
    return ca.Function("p0", [THETA], [p0, ca.gradient(p0, THETA)])


FUNCTIONS = {"sum": cost_function("sum"), "closest": cost_function("closest")}
DISTANCES = ca.Function("d", [THETA], [ca.horzcat(*[link_distances(ARM, THETA, o) for o in DISCS])])


def p0(d: np.ndarray, s: float, d_m: float, d_b: float) -> np.ndarray:
    return s / 3.0 * np.maximum(0.0, d_m * (d_m - d) / (d_m - d_b)) ** 3


@pytest.mark.parametrize("distance", [0.0, 0.1, 0.2, 0.5, 0.7999, 0.8, 0.9, 5.0])
def test_formula(distance: float) -> None:
    value = DistanceCost(100.0, 0.8).at_distance(ca.SX(distance), 0.2)
    assert float(value) == pytest.approx(p0(np.array(distance), 100.0, 0.8, 0.2), rel=1e-13)


def test_value_at_the_edge_of_the_disc() -> None:
    edge = DistanceCost(100.0, 0.8).at_distance(ca.SX(0.2), 0.2)
    assert float(edge) == pytest.approx(100.0 * 0.8**3 / 3.0)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_combinations(theta: list[float]) -> None:
    d = np.array(DISTANCES(theta))
    costs = np.stack([p0(d[:, i], 100.0, 0.8, o.radius) for i, o in enumerate(DISCS)], axis=1)
    assert float(FUNCTIONS["sum"](theta)[0]) == pytest.approx(costs.sum(), rel=1e-9, abs=1e-12)
    closest = costs.max(axis=0).sum()
    assert float(FUNCTIONS["closest"](theta)[0]) == pytest.approx(closest, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("combine", ["sum", "closest"])
@pytest.mark.parametrize("theta", [(1.3, -1.5, -0.4), (1.1, -0.5, -0.9), (0.4, 0.4, 0.4)])
def test_gradient_against_finite_differences(combine: str, theta: tuple) -> None:
    function, h, at = FUNCTIONS[combine], 1e-6, np.array(theta)
    gradient = np.array(function(at)[1]).ravel()
    for i, e in enumerate(np.eye(3)):
        slope = (float(function(at + h * e)[0]) - float(function(at - h * e)[0])) / (2 * h)
        assert gradient[i] == pytest.approx(slope, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("combine", ["sum", "closest"])
def test_gradient_is_finite_where_a_link_goes_through_the_centre(combine: Combine) -> None:
    cost = DistanceCost(100.0, 0.8, combine)
    through = Disc(np.array(ARM.joints([0.3, 0.2, 0.1]))[:, 1:3].mean(axis=1), 0.2)
    value = cost.of(ARM, THETA, (through,))
    derivatives = [ca.gradient(value, THETA), ca.hessian(value, THETA)[0]]
    for derivative in ca.Function("d", [THETA], derivatives)([0.3, 0.2, 0.1]):
        assert np.isfinite(np.array(derivative)).all()


def test_smoothness_and_no_obstacles() -> None:
    assert DistanceCost(1.0, 1.0).smoothness == 1
    assert DistanceCost(1.0, 1.0, "closest").smoothness == 0
    assert float(DistanceCost(1.0, 1.0).of(ARM, THETA, ())) == 0.0


@pytest.mark.parametrize(
    ("gain", "influence", "combine", "message"),
    [
        (-1.0, 0.8, "sum", "gain = -1.0, it must be 0 or more"),
        (np.nan, 0.8, "sum", "gain = nan"),
        (1.0, 0.0, "sum", "influence = 0.0"),
        (1.0, 0.8, "mean", "combine = 'mean'"),
    ],
)
def test_bad_numbers(gain: float, influence: float, combine: Combine, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        DistanceCost(gain, influence, combine)


@pytest.mark.parametrize("influence", [0.1, 0.2])
def test_influence_must_reach_beyond_the_disc(influence: float) -> None:
    with pytest.raises(ProblemError, match=r"must be larger than the radius 0\.\d m"):
        DistanceCost(1.0, influence).of(ARM, THETA, DISCS)
