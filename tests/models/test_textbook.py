"""The textbook problems: optima by derivation, and by a boundary value solver of scipy."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import quad, solve_bvp, solve_ivp

from models.textbook import (
    bryson_denham,
    discrete_double_integrator,
    double_integrator_energy,
    double_integrator_minimum_time,
    hypersensitive,
    rayleigh,
    van_der_pol,
)
from ocp import OCP, FreeTime, ProblemError, minimum_principle

PROBLEMS = (
    bryson_denham,
    double_integrator_energy,
    double_integrator_minimum_time,
    hypersensitive,
    rayleigh,
    van_der_pol,
)


@pytest.mark.parametrize("build", PROBLEMS)
def test_each_describes_itself_and_documents_its_optimum(build: Callable[[], OCP]) -> None:
    assert "minimise" in build().describe()
    assert "ptimum" in (build.__doc__ or "")


def final_state(ocp: OCP, control: Callable[[float], float], duration: float) -> np.ndarray:
    """Return where a control leads."""

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return np.array(ocp.functions.rate(x, control(t), t, [])).ravel()

    run = solve_ivp(rate, (0.0, duration), np.asarray(ocp.x0), max_step=0.02, rtol=1e-9, atol=1e-9)
    return run.y[:, -1]


def test_energy_optimum_is_6() -> None:
    ocp = double_integrator_energy()
    end = final_state(ocp, lambda t: 6.0 - 12.0 * t, 1.0)
    np.testing.assert_allclose(end, [1.0, 0.0], atol=1e-5)
    assert quad(lambda t: (6.0 - 12.0 * t) ** 2 / 2, 0.0, 1.0)[0] == pytest.approx(6.0)
    control = minimum_principle(ocp).control([0.0, 0.0], [-12.0, -6.0], 0.0, [])
    assert float(control) == pytest.approx(6.0)


def test_minimum_time_is_2() -> None:
    ocp = double_integrator_minimum_time()
    assert isinstance(ocp.horizon, FreeTime)
    end = final_state(ocp, lambda t: 1.0 if t < 1.0 else -1.0, 2.0)
    np.testing.assert_allclose(end, [1.0, 0.0], atol=1e-6)
    assert float(ocp.functions.running_cost(end, 1.0, 0.0, [])) == 1.0


def test_bryson_denham_optimum_is_4() -> None:
    def control(t: float) -> float:
        return -6.0 * max(0.0, 1.0 - 3.0 * min(t, 1.0 - t))

    ocp = bryson_denham()
    end = final_state(ocp, control, 1.0)
    np.testing.assert_allclose(end, [0.0, -1.0], atol=1e-5)
    cost = quad(lambda t: control(t) ** 2 / 2, 0.0, 1.0, points=[1 / 3, 2 / 3])[0]
    assert cost == pytest.approx(4.0)
    np.testing.assert_allclose(np.asarray(ocp.state_bounds.upper), [1.0 / 9.0, np.inf])


@pytest.mark.many
@pytest.mark.parametrize(
    ("build", "reference"),
    [(van_der_pol, 1.047806908220), (rayleigh, 29.376079655945), (hypersensitive, 1.330806904945)],
)
def test_reference_optimum_from_a_boundary_value_problem(
    build: Callable[[], OCP], reference: float
) -> None:
    ocp = build()
    optimality, nx = minimum_principle(ocp), ocp.model.nx
    duration, x0 = ocp.duration, np.asarray(ocp.x0)

    def flow(t: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.array(optimality.flow(z, t[None, :], np.empty((0, 1))))

    def ends(first: np.ndarray, last: np.ndarray) -> np.ndarray:
        bound = bool(ocp.at("terminal"))
        return np.append(first[:nx] - x0, last[:nx] - 1.0 if bound else last[nx:])

    t = np.unique(np.concatenate([np.linspace(0.0, duration, 200), np.geomspace(1e-3, 5.0, 50)]))
    t = np.unique(np.concatenate([t[t <= duration], duration - t[t <= duration]]).round(4))
    fade = np.exp(-t)
    guess = np.vstack([x0[:, None] * fade, np.tile(fade, (nx, 1))])
    bvp = solve_bvp(flow, ends, t, guess, tol=1e-9, max_nodes=50_000)
    assert bvp.success
    z = bvp.sol(fine := np.linspace(0.0, duration, 200_001))
    p = np.empty((0, 1))
    u = optimality.control(z[:nx], z[nx:], fine[None, :], p)
    costs = np.array(ocp.functions.running_cost(z[:nx], u, fine[None, :], p)).ravel()
    assert np.trapezoid(costs, fine) == pytest.approx(reference, rel=1e-7)


def test_discrete_optimum_is_that_of_the_riccati_recursion() -> None:
    """Against one stacked least-squares problem in all controls."""
    steps, dt = 20, 0.1
    ocp = discrete_double_integrator(steps, dt)
    assert (ocp.steps, ocp.duration) == (steps, pytest.approx(2.0))
    a, b = np.array([[1.0, dt], [0.0, 1.0]]), np.array([[dt**2 / 2], [dt]])
    np.testing.assert_allclose(
        np.array(ocp.functions.rate([1.0, 2.0], 3.0, 0.0, [])).ravel(), a @ [1, 2] + b @ [3]
    )
    p = np.eye(2)
    for _ in range(steps):
        gain = np.linalg.solve(np.eye(1) + b.T @ p @ b, b.T @ p @ a)
        p = np.eye(2) + a.T @ p @ (a - b @ gain)
    x, free, forced = np.asarray(ocp.x0), [], np.zeros((2 * steps, steps))
    for k in range(steps):
        free.append(np.linalg.matrix_power(a, k + 1) @ x)
        for j in range(k + 1):
            forced[2 * k : 2 * k + 2, [j]] = np.linalg.matrix_power(a, k - j) @ b
    u = np.linalg.lstsq(
        np.vstack([forced, np.eye(steps)]), np.append(-np.hstack(free), np.zeros(steps)), rcond=None
    )[0]
    cost = 0.0
    for k in range(steps):
        cost += float(ocp.functions.running_cost(x, u[k], k * dt, []))
        x = np.array(ocp.functions.rate(x, u[k], k * dt, [])).ravel()
    cost += float(ocp.functions.terminal_cost(x, steps * dt, []))
    assert cost == pytest.approx(p[0, 0], rel=1e-10)


@pytest.mark.parametrize(
    ("steps", "dt", "message"),
    [
        (0, 0.1, "steps must be .* not 0"),
        (1.5, 0.1, "steps must be .* not 1.5"),
        (3, 0.0, "dt = 0.0"),
        (3, np.nan, "dt"),
    ],
)
def test_bad_discrete_problems(steps: int, dt: float, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        discrete_double_integrator(steps, dt)
