"""The cart-pole in closed loop: up, and within its force and its track."""

import numpy as np
import pytest

from benchmarks.mpc.cart_pole_loop import (
    FORCE,
    HORIZONS,
    TRACK,
    Setting,
    loop,
    plant,
    problem,
    settings,
    up_since,
)
from ocp import InputSource, Rollout, UnsupportedProblem
from solvers import IndirectShooting, Schuetz


def stands(rollout: Rollout) -> None:
    """Assert that the pole is up for at least the last second, and no bound was broken."""
    assert rollout.violation == 0.0
    assert np.abs(rollout.inputs).max() <= FORCE
    assert np.abs(rollout.x[:, 0]).max() <= TRACK
    settled = up_since(rollout)
    assert settled is not None
    assert settled < rollout.t[-1] - 1.0


@pytest.mark.many
@pytest.mark.parametrize("horizon", HORIZONS[1:])
def test_it_swings_up_and_stays(horizon: float) -> None:
    rollout = loop(Setting("nominal", "fatrop", horizon)).or_raise()
    assert set(rollout.sources) == {InputSource.OPTIMAL}
    assert np.abs(rollout.inputs).max() == pytest.approx(FORCE, abs=1e-6)
    stands(rollout)
    np.testing.assert_allclose(rollout.x[-1], [0.0, np.pi, 0.0, 0.0], atol=5e-3)


def test_half_a_second_is_too_short() -> None:
    rollout = loop(Setting("nominal", "fatrop", 0.5)).or_raise()
    assert up_since(rollout) is None
    assert rollout.violation == 0.0


@pytest.mark.slow
def test_backends_agree() -> None:
    ours, theirs = (loop(Setting("nominal", s, 1.0)).or_raise() for s in ("ipopt", "fatrop"))
    np.testing.assert_allclose(ours.x, theirs.x, atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_it_stays_up_with_another_pole_and_noise(seed: int) -> None:
    stands(loop(Setting("10 % off, noise", "fatrop", 1.0), seed=seed).or_raise())


@pytest.mark.slow
def test_five_segments_hold_what_single_shooting_loses() -> None:
    """Single shooting integrates an unstable pole over the whole horizon."""
    five = loop(Setting("nominal", "shooting-5", 1.0)).or_raise()
    stands(five)
    assert max(decision.residual for decision in five.decisions) < 1e-7
    one = loop(Setting("nominal", "shooting", 0.75)).or_raise()
    assert up_since(one) is None


def test_the_plant_is_judged_by_the_hard_track() -> None:
    hard, soft = plant("nominal").ocp, problem(1.0)
    np.testing.assert_array_equal(np.asarray(hard.state_bounds.upper)[0], TRACK)
    assert not soft.state_bounds.is_active
    for solver in (IndirectShooting(), Schuetz.sound()):
        with pytest.raises(UnsupportedProblem, match="takes no state bounds"):
            solver.build(hard)
    heavier = plant("20 % off, noise").ocp
    x, u = [0.0, 1.0, 0.0, 1.0], 1.0
    rates = [np.array(o.functions.rate(x, u, 0.0, [])).ravel() for o in (hard, heavier)]
    assert np.abs(rates[0] - rates[1]).max() > 0.1


def test_slow_solvers_run_at_one_horizon() -> None:
    chosen = settings(HORIZONS)
    assert len(set(chosen)) == len(chosen)
    assert sum(s.solver in ("shooting", "schuetz-sound") for s in chosen) == 2
    assert {s.solver for s in settings((1.0,))} == {
        "ipopt", "fatrop", "newton", "shooting-5",
    }  # fmt: skip
