"""A method that hangs or crashes costs its row, and no other."""

import pytest

from benchmarks.methods.method import Settings
from benchmarks.sweep.error import SweepError
from benchmarks.sweep.guard import Group, run_group
from benchmarks.sweep.row import CRASHED, TIMED_OUT, Row
from benchmarks.sweep.task import SweepTask
from tests.benchmarks.test_sweep import QUICK


def group(*methods: str, limit: float = 30.0) -> Group:
    tasks = [SweepTask(QUICK.suite, QUICK.name, m, "", Settings()) for m in methods]
    return Group(tuple(tasks), limit, "tests.benchmarks.faulty_child")


@pytest.mark.slow
def test_a_crash_costs_its_row_and_not_the_next():
    first, second = run_group(group("segfaults", "good"))
    assert (first.status, second.solved) == (CRASHED, True)


@pytest.mark.slow
def test_every_way_to_fail_costs_one_row():
    faults = {
        "segfaults": "SIGSEGV",
        "leaves": "code 3",
        "leaves_quietly": "code 0",
        "is_killed": "memory is short",
        "runs_out_of_memory": "MemoryError",
        "raises": "ValueError: a mistake in the method",
    }
    rows = run_group(group("good", *faults, "good"))
    assert [row.solver for row in rows] == ["good", *faults, "good"]
    assert rows[0].solved
    assert rows[-1].solved
    for row in rows[1:-1]:
        assert row.status == CRASHED
        assert row.is_lost
        assert faults[row.solver] in row.message
        assert not row.solved
        assert row.cost is None
        assert Row.parse(row.line()) == row


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["hangs", "spins"])
def test_the_time_limit_reaches_compiled_code(fault):
    first, second = run_group(group(fault, "good", limit=2.0))
    assert first.status == TIMED_OUT
    assert first.message == "stopped at the time limit of 2 s"
    assert second.solved


@pytest.mark.slow
def test_what_a_method_prints_is_no_answer():
    (row,) = run_group(group("talks"))
    assert row.solved


def test_where_no_process_starts_nothing_is_recorded():
    with pytest.raises(SweepError, match=r"libmissing\.so"):
        run_group(Group(group("good").tasks, 1.0, "tests.benchmarks.mute_child"))


@pytest.mark.slow
def test_the_keyboard_ends_the_group():
    with pytest.raises(SweepError, match="interrupted"):
        run_group(group("is_interrupted", "good"))
