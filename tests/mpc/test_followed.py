"""On a nominal plant every plan that its solver calls SOLVED acts, whatever the problem has."""

import pytest

from benchmarks.mpc.followed import FEATURES, random_loops


@pytest.mark.slow
def test_random_loops_follow_their_plans() -> None:
    loops = list(random_loops(60))
    assert all(loop.is_good for loop in loops), [loop for loop in loops if not loop.is_good]
    assert {name for loop in loops for name in loop.features} == set(FEATURES)
    assert sum(loop.solved for loop in loops) > 0.9 * sum(loop.steps for loop in loops) > 0


def test_a_loop_is_the_same_for_the_same_seed() -> None:
    one, other = (list(random_loops(2, seed=7)) for _ in range(2))
    assert one == other
