"""The commands that measure linear and greedy control."""

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.questions.greedy_gap import PROBLEMS, gap
from benchmarks.speed.linear import Growth, situations


@pytest.mark.slow
def test_speed_prints_growth(capsys):
    assert main(["speed", "--horizons", "5", "10", "--count", "3"]) == 0
    shown = capsys.readouterr().out
    for method in ("LinearMPC, sparse", "LinearMPC, condensed", "Riccati", "Batch"):
        assert method in shown


def test_situations_have_active_constraints_and_their_own_reference():
    seen = situations(10, 5)
    assert len(seen) == 5
    for now in seen:
        assert now.ahead.shape == (11, 2)
        assert now.ahead[0, 0] == pytest.approx(3 * np.sin(2 * np.pi * now.t / 4))


def test_exponent_is_the_slope_of_the_long_horizons():
    line = Growth("m", (10, 50, 100, 200), (9.0, 0.5, 1.0, 2.0))
    assert line.exponent == pytest.approx(1.0)
    assert Growth("m", (10, 50), (1.0, 2.0)).exponent is None


# Measured once, by this command.
RATIOS = {"stable plant 2.50": 26.66, "mass 2.92": 14.07, "Van der Pol": 2.01}


@pytest.mark.many
@pytest.mark.parametrize("name", PROBLEMS)
def test_greedy_costs_more_on_every_plant(name):
    found = gap(name)
    assert found.ratio > 1.0
    if name in RATIOS:
        assert found.ratio == pytest.approx(RATIOS[name], rel=2e-3)
