"""``native-speed``: the layers of a control step."""

import pytest

from benchmarks.speed.native import layers, layers_table, races


@pytest.mark.slow
def test_a_step_contains_a_run_and_a_run_the_solve() -> None:
    race = next(race for race in races() if "short track" in race.name)
    found = layers(race, 5)
    assert len(found.in_c) == len(found.run) == len(found.step) == len(found.busy) == 5
    assert (found.in_c < found.run).all()
    assert (found.run < found.step).all()
    assert found.optimal == 1.0
    assert layers_table(race, found).row_count == 4
