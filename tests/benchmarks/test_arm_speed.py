"""The command that measures MPC on the arm."""

import pytest

from benchmarks.speed.arm import Field, Steps, arm, exponent, race, stagewise
from benchmarks.speed.arm_tables import growth_table, ratio_table
from benchmarks.speed.driver_overhead import driver_overhead, overhead_table
from benchmarks.speed.stage_code import StageCode, code_table
from ocp import Compiler
from solvers import Schuetz


def test_ratios_are_taken_step_by_step():
    slow = Steps("a", False, (2.0, 8.0, 4.0), 1.0)
    fast = Steps("a", True, (1.0, 1.0, 4.0), 1.0)
    assert fast.over(slow) == pytest.approx(0.5)
    assert fast.median == 1.0
    assert ratio_table([slow, fast]).row_count == 2


def test_exponent_is_the_slope_in_the_logarithms():
    assert exponent((10, 20, 40), (1.0, 4.0, 16.0)) == pytest.approx(2.0)


@pytest.mark.slow
def test_interpreted_and_compiled_steps_are_both_planned():
    fields = {n: Field(arm(), {"gradient": Schuetz.sound(intervals=n)}) for n in (6, 8)}
    grown = race(fields, 3)
    for steps in grown.values():
        assert [s.compiled for s in steps] == [False, True]
        assert all(s.planned == 1.0 and len(s.times) == 3 for s in steps)
    assert growth_table(grown, "two sizes").row_count == 2


def test_the_time_of_a_step_is_all_in_this_process():
    assert not any(getattr(s, "time_limit", 0.0) is None for s in stagewise().values())


@pytest.mark.slow
def test_the_drivers_own_time_is_told():
    found = driver_overhead(count=5)
    assert [line.solver for line in found][::3] == ["stand-in", "fatrop"]
    assert all(0.0 < line.driver.least <= line.driver.median for line in found)
    assert overhead_table(found).row_count == len(found) == 5


def test_code_beyond_the_compilers_limit_is_named():
    short, long = (StageCode(3, 9, size, 5, 1.0) for size in (7, Compiler().optimised + 1))
    assert short.optimised
    assert not long.optimised
    assert code_table([short, long]).row_count == 5


@pytest.mark.slow
@pytest.mark.skipif(not Compiler().found, reason="no compiler on this machine")
def test_put_together_a_stage_takes_less_code():
    code = StageCode.of(3)
    assert code.curvature < code.assembled < code.written_out / 2
    assert code.build > 0.0
