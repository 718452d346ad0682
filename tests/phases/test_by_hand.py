"""The same chain written by hand in plain CasADi has the same optimum."""

import pytest

from benchmarks.speed.phases import ByHand, arm, ball, compared, rocket
from tests.tolerances import ROUNDING

CHAINS = [ball(), rocket(), pytest.param(arm(4), marks=pytest.mark.slow, id="arm")]


@pytest.mark.parametrize("chain", CHAINS, ids=lambda chain: chain.name)
def test_the_optimum_is_that_of_a_chain_by_hand(chain):
    found = compared(chain, 10, runs=1)
    assert found.cost == pytest.approx(found.cost_by_hand, rel=ROUNDING)
    assert min(*found.build, *found.resolve) > 0.0


@pytest.mark.slow  # two programs of an arm
def test_a_cut_arm_is_the_arm():
    assert ByHand(arm(2), 20).run() == pytest.approx(ByHand(arm(4), 10).run(), rel=ROUNDING)
