"""What docs/schuetz.md says, from the data of its figures."""

import numpy as np
import pytest

from benchmarks.figures import chosen
from benchmarks.figures.descent_gap import THESIS


def data_of(number: str) -> dict[str, np.ndarray]:
    (figure,) = chosen([number])
    return {name: np.asarray(column) for name, column in figure.draw().columns.items()}


@pytest.mark.slow
def test_the_climb_needs_conjugate_directions_and_a_fixed_step():
    data = data_of("3.13a")
    rising = data["L, Fletcher-Reeves, fixed step [rad^2/s]"]
    assert rising[-1] > 1e3 * rising.min()
    for name in ("steepest descent, the same step", "Fletcher-Reeves, line search"):
        costs = data[f"L, {name} [rad^2/s]"]
        assert costs[-1] <= 1.001 * costs.min()
    conjugate, plain = (
        data[f"highest over lowest cost after it, {name} [-]"] - 1.0
        for name in ("Fletcher-Reeves", "steepest")
    )
    assert (conjugate > 1e-3).sum() >= 5
    assert (plain > 1e-3).sum() <= 1


@pytest.mark.slow
def test_the_gap_is_a_matter_of_the_step():
    data = data_of("3.13b")
    small, large = (int(np.flatnonzero(data["alpha [-]"] == a)[0]) for a in (0.01, 0.1))
    gaps = np.array([column for name, column in data.items() if name.startswith("gap of")])
    assert len(gaps) == 36
    assert np.median(gaps[:, small]) < 0.1
    for name in ("arm-001", "arm-003"):
        gap = data[f"gap of {name}-closest [%]"]
        assert gap[small] < 0.1
        assert gap[large] > THESIS - 1.0
