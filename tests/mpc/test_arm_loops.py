"""The arm in closed loop: what a horizon of 0.35 s, the longest and the shortest come to."""

import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from benchmarks.mpc.arm_loop import intervals, loop, problem
from benchmarks.mpc.dial import optimum, stays_below
from benchmarks.mpc.endings import ENDINGS, ending
from benchmarks.mpc.late import delayed_loops
from benchmarks.mpc.loop_row import LoopRow, found, read_loops
from benchmarks.mpc.mass_loop import receding
from ocp import InputSource, Rollout, Status

NAME = "arm-001"


def run(kind: str, horizon: float) -> Rollout:
    return loop(arm_scenario(NAME), kind, horizon).or_raise()


def test_no_control_is_held_for_less_than_a_sampling_interval() -> None:
    assert [intervals(h) for h in (0.01, 0.02, 0.06, 0.35, 1.5)] == [1, 1, 3, 17, 75]


def test_after_its_end_the_task_costs_nothing() -> None:
    ocp = problem(arm_scenario(NAME), 0.5)
    rest = np.zeros(3)
    before, after = (float(ocp.functions.running_cost([2.0, -1.0, 0.5], rest, t, []))
                     for t in (1.49, 1.5))  # fmt: skip
    assert before > 0.1
    assert after == 0.0


@pytest.mark.parametrize("kind", ENDINGS)
def test_every_ending_is_a_problem(kind: str) -> None:
    made = ending(arm_scenario(NAME), 0.1, kind)
    names = [parameter.name for parameter in made.ocp.parameters]
    assert names == (["slope"] if kind == "previous plan" else [])
    assert set(made.parameters(1.45) if made.parameters else {}) == set(names)


def row(horizon: float, cost: float | None, controller: str = "direct") -> LoopRow:
    return LoopRow(
        case=NAME, controller=controller, horizon=horizon, part=cost, cost=cost, drift=0.0,
        violation=0.0, residual=None, sources={}, statuses={}, times=(0.0, 0.0, 0.0), ended="",
    )  # fmt: skip


def test_rows_are_written_and_compared(tmp_path) -> None:
    rows = [row(0.1, 3.0), row(0.2, 1.0), row(0.3, 1.5), row(0.4, None), row(0.4, 1.0)]
    for each in rows:
        each.append_to(tmp_path / "loops.jsonl")
    back = read_loops(tmp_path / "loops.jsonl")
    assert back == (*rows[:3], rows[4])
    mine = found(back, NAME, "direct")
    assert stays_below(mine, row(0.0, 2.0), part=True) == 0.2
    assert stays_below(mine, row(0.0, 1.2), part=False) == 0.4
    assert stays_below(mine, row(0.0, 0.5), part=False) is None


@pytest.mark.slow
def test_the_mass_stays_behind_its_bound() -> None:
    rollout = receding(20, bounded=True).or_raise()
    assert set(rollout.sources) == {InputSource.OPTIMAL}
    assert rollout.violation < 1e-6


@pytest.mark.slow
def test_three_solvers_agree_over_a_third_of_a_second() -> None:
    runs = {kind: run(kind, 0.35) for kind in ("direct", "shooting", "schuetz")}
    for rollout in runs.values():
        assert rollout.cost == pytest.approx(runs["direct"].cost, rel=1e-2)
        assert all(source.is_planned for source in rollout.sources)
    assert max(d.residual for d in runs["shooting"].decisions) < 1e-4
    ends = {decision.status for decision in runs["schuetz"].decisions}
    assert ends <= {Status.SMALL_DECREASE, Status.COST_ROSE, Status.SOLVED, Status.STATIONARY}


@pytest.mark.slow
def test_the_dial_ends_at_the_optimum() -> None:
    best = optimum(NAME)
    assert run("schuetz-sound", 1.5).cost == pytest.approx(best, rel=1e-2)
    assert run("direct", 0.02).cost > 1.01 * best


@pytest.mark.slow
def test_compensation_leaves_only_the_wait() -> None:
    prompt, on, off = (rollout.or_raise().cost for rollout in delayed_loops(NAME, 0.35).values())
    assert on == pytest.approx(prompt, rel=0.05)
    assert off > 1.01 * on
