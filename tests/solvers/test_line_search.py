"""Step rules on functions of one variable."""

from itertools import pairwise

import numpy as np
import pytest

from ocp import ProblemError
from solvers import Armijo, FixedStep
from solvers.gradient.line_search import LineSearchTrial


def probe_of(f, seen: list[float] | None = None):
    """A probe whose trial carries the step as its only control."""

    def probe(step: float) -> LineSearchTrial:
        if seen is not None:
            seen.append(step)
        return LineSearchTrial(np.array([[step]]), np.zeros((2, 1)), f(step))

    return probe


def parabola(step: float) -> float:
    """Slope -2 at 0, least at 1, with -1."""
    return step**2 - 2.0 * step


def test_fixed_step_asks_nothing() -> None:
    seen: list[float] = []
    taken = FixedStep(0.3).advance(probe_of(parabola, seen), 0.0, -2.0, 7.0)
    assert taken is not None
    assert (taken[1], seen) == (0.3, [0.3])


@pytest.mark.parametrize("first", [0.01, 0.3, 0.9, 1.0, 1.3, 1.9, 3.0, 40.0, 1e4])
def test_armijo_finds_the_minimum_of_a_parabola(first: float) -> None:
    """At most ten times the first step in one search, and never without a decrease."""
    taken = Armijo().advance(probe_of(parabola), 0.0, -2.0, first)
    assert taken is not None
    trial, step = taken
    assert trial.cost < 0.0
    assert trial.cost <= 1e-4 * step * -2.0
    if first >= 0.1:
        assert trial.cost == pytest.approx(-1.0, abs=0.05)


def test_armijo_backs_out_of_where_the_state_blows_up() -> None:
    taken = Armijo().advance(
        probe_of(lambda s: parabola(s) if s < 0.5 else np.inf), 0.0, -2.0, 100.0
    )
    assert taken is not None
    assert taken[1] < 0.5
    assert taken[0].cost < 0.0


def test_armijo_gives_up() -> None:
    seen: list[float] = []
    rule = Armijo(most=5)
    assert rule.advance(probe_of(lambda s: s, seen), 0.0, -1.0, 1.0) is None
    assert len(seen) == 5
    assert all(0.1 - 1e-12 <= b / a <= 0.5 + 1e-12 for a, b in pairwise(seen))


def test_armijo_demands_a_share_of_the_slope() -> None:
    """A decrease of 0.4 of what the slope promises is enough for 0.3 and not for 0.45."""

    def slow(step: float) -> float:
        return -0.4 * step

    for decrease, accepted in ((0.3, True), (0.45, False)):
        taken = Armijo(decrease=decrease, most=3).advance(probe_of(slow), 0.0, -1.0, 1.0)
        assert (taken is not None) is accepted


def test_armijo_at_the_edge_of_floating_point() -> None:
    taken = Armijo().advance(probe_of(lambda s: -s if s < 1e307 else np.inf), 0.0, -1.0, 1e306)
    assert taken is not None
    assert np.isfinite(taken[1])


@pytest.mark.parametrize(
    "make",
    [
        lambda: FixedStep(0.0),
        lambda: FixedStep(-1.0),
        lambda: FixedStep(float("nan")),
        lambda: Armijo(decrease=0.0),
        lambda: Armijo(decrease=0.5),
        lambda: Armijo(most=0),
    ],
)
def test_bad_options(make) -> None:
    with pytest.raises(ProblemError):
        make()
