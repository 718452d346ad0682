"""The Jacobian of the boundary value problem against finite differences."""

import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from models.textbook import van_der_pol
from ocp import OCP, RK4
from ocp.problem.run_data import RunData
from solvers.indirect.boundary_value_problem import ExtremalProblem
from solvers.indirect.shooting_segments import ShootingSchedule
from tests.ocp.differences import jacobian
from tests.solvers.problems import (
    circle_start,
    quartic,
    saturated_transfer,
    timed_transfer,
    tracker,
)
from tests.tolerances import DERIVATIVE

PROBLEMS = {
    "plain": van_der_pol,
    "free time, terminal constraint": timed_transfer,
    "manifold start": lambda: circle_start((0.8, 0.5)),
    "signals": tracker,
    "implicit control": quartic,
    "saturated": lambda: saturated_transfer()[0],
    "arm, free start": lambda: arm_scenario("arm-002").ocp(free_start=True),
}


@pytest.mark.many
@pytest.mark.parametrize("segments", [1, 4])
@pytest.mark.parametrize("name", PROBLEMS)
def test_jacobian(name: str, segments: int) -> None:
    ocp: OCP = PROBLEMS[name]()
    extremals = ExtremalProblem.of(ocp, segments, 3, RK4())
    data = RunData.of(ocp, t0=0.2)
    schedule = ShootingSchedule.of(ocp, data, 3 * segments)
    rng = np.random.default_rng(1)
    shape = extremals.shape
    z = np.tile(np.concatenate([data.x0, np.zeros(shape.nx)]), (segments, 1))
    z += 0.2 * rng.normal(size=z.shape)
    mu, nu = rng.normal(size=shape.n_mu), rng.normal(size=shape.n_nu)
    v = shape.join(z, mu, nu, 1.1 * ocp.duration)

    def residual(v: np.ndarray) -> np.ndarray:
        return extremals.residual(v, schedule, data.x0)[0]

    _, paths = extremals.residual(v, schedule, data.x0)
    duration = shape.split(v, schedule.duration)[-1]
    slopes = extremals.segment_slopes(paths, schedule, duration)
    got = extremals.jacobian(v, paths, schedule, data.x0, slopes).toarray()
    expected = jacobian(residual, v)
    assert got.shape == (len(v), len(v))
    # Central differences err with the third derivative, which grows as the entries do.
    np.testing.assert_allclose(got, expected, rtol=DERIVATIVE, atol=DERIVATIVE * np.abs(got).max())


def test_layout_of_the_unknowns() -> None:
    shape = ExtremalProblem.of(timed_transfer(), 2, 3, RK4()).shape
    z, nu = np.arange(8.0).reshape(2, 4), np.array([8.0, 9.0])
    v = shape.join(z, np.empty(0), nu, 1.5)
    np.testing.assert_array_equal(v, [*range(10), 1.5])
    back = shape.split(v, np.nan)
    np.testing.assert_array_equal(back[0], z)
    np.testing.assert_array_equal(back[2], nu)
    assert back[3] == 1.5


def test_segments_together_are_the_whole_horizon() -> None:
    """Started on one trajectory, many segments reproduce it and have no gaps."""
    ocp = van_der_pol()
    data = RunData.of(ocp, t0=0.0)
    one, four = ExtremalProblem.of(ocp, 1, 8, RK4()), ExtremalProblem.of(ocp, 4, 2, RK4())
    schedule = ShootingSchedule.of(ocp, data, 8)
    start = np.array([[1.0, 0.0, 1.7, 0.1]])
    whole = one.paths(start, schedule, ocp.duration)
    parts = four.paths(whole.nodes[:-1:2], schedule, ocp.duration)
    np.testing.assert_allclose(parts.nodes, whole.nodes, rtol=1e-14)
    np.testing.assert_allclose(parts.costs, whole.costs, rtol=1e-14)
    residual, _ = four.residual(whole.nodes[:-1:2].ravel(), schedule, data.x0)
    np.testing.assert_allclose(residual[:-2], 0.0, atol=1e-14)
