"""Figs. 3.8 to 3.11 and the basins: drawn, with the numbers they are drawn for."""

import numpy as np
import pytest

from benchmarks.figures import chosen, draw_all


def drawn(number, out):
    ((figure, drawing),) = draw_all(chosen([number]), out)
    assert (out / f"{figure.stem}.png").read_bytes().startswith(b"\x89PNG")
    assert drawing.sentence.startswith(f"Fig. {number}: ")
    assert "Chosen here" in drawing.sentence
    assert all(name.endswith("]") for name in drawing.columns), "every column has a unit"
    return drawing.columns


def test_the_self_motion_is_a_closed_curve(tmp_path):
    data = drawn("3.8", tmp_path)
    theta = np.stack([data[f"θ_{i} [rad]"] for i in (1, 2, 3)], axis=1)
    np.testing.assert_allclose(theta[0], theta[-1], atol=1e-12)


@pytest.mark.slow
def test_transversality_vanishes_where_the_cost_is_least(tmp_path):
    data = drawn("3.9", tmp_path)
    least = np.argmin(data["cost [rad²/s]"])
    norms = data["‖N ψ(t_0)‖ [1/s]"]
    # The scan has points 0.05 rad apart; the norm is ten times as large elsewhere.
    assert norms[least] < 0.1 * norms.max()


@pytest.mark.slow
def test_the_start_is_met_where_the_end_is_right(tmp_path):
    data = drawn("3.11", tmp_path)
    assert data["‖θ_int − θ_0‖ [rad]"].min() < 0.1


@pytest.mark.slow
def test_with_an_obstacle_there_are_many_extremals(tmp_path):
    data = drawn("3.10", tmp_path)
    costs = data["extremals of type 4, cost [rad²/s]"]
    assert len(costs) == 11
    assert (np.diff(costs) > 0.0).all()


@pytest.mark.slow
def test_single_shooting_seldom_finds_the_optimum(tmp_path):
    data = drawn("basin", tmp_path)
    kind = data["extremal, in the order of cost; -1: none [-]"]
    assert 0.0 < np.mean(kind == 0) < 0.1
    # Every extremal of the scan is met by some run.
    assert set(range(11)) <= set(kind.tolist())
