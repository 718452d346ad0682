"""The fault campaign at 3,000 steps; ``python -m benchmarks faults`` runs more."""

from functools import reduce
from itertools import pairwise
from operator import add
from pathlib import Path

import numpy as np
import pytest

from benchmarks.mpc.faults import campaign
from benchmarks.mpc.faulty import KINDS, active, schedule
from ocp import MPC, FlightRecorder, Plant, ProblemError, replay_all
from solvers import MultipleShooting
from tests.mpc.problems import cart


def test_a_schedule_is_seeded_and_leaves_calm_between_faults() -> None:
    faults = schedule(2000, 3)
    assert faults == schedule(2000, 3) != schedule(2000, 4)
    assert {fault.kind for fault in faults} == set(KINDS)
    gaps = [after.first - before.last for before, after in pairwise(faults)]
    assert min(gaps) > 10
    assert active(faults, 0.1 * faults[0].last, 0.1) == faults[0]
    assert active(faults, 0.1 * (faults[0].last + 1), 0.1) is None


@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize(("subject", "steps"), [("cart", 1500), ("arm", 600), ("heating", 900)])
def test_no_fault_gets_through(subject: str, steps: int) -> None:
    report = reduce(add, campaign(subject, steps, seed=1))
    assert report.steps == steps
    assert report.is_clean, report
    assert set(report.faults) == set(KINDS)
    assert report.replayed > 0.05 * steps


@pytest.mark.slow
def test_many_steps_are_replayed_with_one_controller(tmp_path: Path) -> None:
    mpc = MPC(ocp=cart(), solver=MultipleShooting(10), dt=0.1)
    with FlightRecorder(mpc, tmp_path / "flight") as recorder:
        mpc.run(Plant(ocp=cart(mass=1.1)), [1.0, 0.0], 0.5, watch=recorder.watch)
    found = list(replay_all(mpc, tmp_path / "flight", range(1, 5)))
    assert [step.record.t for step in found] == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert all(step.is_exact for step in found)
    first, second = (step.record.input for step in found[:2])
    assert first is not None
    assert second is not None
    assert not np.array_equal(first, second)
    with pytest.raises(ProblemError, match="has no step 7"):
        list(replay_all(mpc, tmp_path / "flight", [2, 7]))
