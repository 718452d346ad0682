from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from models import Carima, CarimaPlant, carima_ocp
from ocp import OCP, Box, ProblemError, Status, solve
from solvers import GPC, LinearMPC, MultipleShooting, gpc_loop
from solvers.predictive.diophantine import diophantine
from tests.tolerances import ROUNDING

THESIS = Carima([1.0, -0.8], [0.4, 0.6])
LATE = Carima([1.0, -0.8], [0.4, 0.6], delay=2)
COLOURED = Carima([1.0, -1.5, 0.7], [0.4, 0.6, 0.1], [1.0, 0.5, 0.2], delay=1)
# One coefficient of everything, and a plant without memory: blocks of the state are empty.
SIMPLE, MEMORYLESS = Carima([1.0, -0.9], [0.1]), Carima([1.0], [2.0])
PLANTS = {
    "thesis": THESIS,
    "late": LATE,
    "coloured": COLOURED,
    "simple": SIMPLE,
    "memoryless": MEMORYLESS,
}
# The law and a solver compute the same numbers by different ways; the issue asks for this.
SAME = 1e-9


@pytest.fixture(params=PLANTS.values(), ids=list(PLANTS))
def plant(request) -> Carima:
    return request.param


def measured(steps: int = 40) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outputs y(0..t), inputs u(0..t-1) and a reference that have nothing to do with a plant."""
    rng = np.random.default_rng(3)
    return rng.normal(size=steps), rng.normal(size=steps - 1), rng.normal(size=steps)


def as_problem(model: Carima, n: int, weight: float = 0.8, **bounds: Any) -> OCP:
    y, u, w = measured()
    law = GPC(n2=n, weight=weight).build(model)
    noise = [law.prediction.noise(y[: i + 1], u[:i]) for i in range(1, len(y))]
    return carima_ocp(
        model,
        reference=np.concatenate([[0.0], w[:n]]),
        weight=weight,
        outputs=y,
        inputs=u,
        noise=noise,
        **bounds,
    )


# -- the thesis' numbers --------------------------------------------------------------------


def test_diophantine_of_the_thesis():
    # (2.62) with F_2 and F_3 without the factor that is left in there.
    first, second, third = diophantine([1.0], [1.0, -1.8, 0.8], 3)
    for split, quotient, remainder in (
        (first, [1.0], [1.8, -0.8]),
        (second, [1.0, 1.8], [2.44, -1.44]),
        (third, [1.0, 1.8, 2.44], [2.952, -1.952]),
    ):
        np.testing.assert_allclose(split.quotient, quotient, atol=ROUNDING)
        np.testing.assert_allclose(split.remainder, remainder, atol=ROUNDING)


def test_diophantine_equation_holds(plant):
    denominator = np.convolve(plant.a, [1.0, -1.0])
    for j, split in enumerate(diophantine(plant.c, denominator, 9), 1):
        right = np.convolve(split.quotient, denominator)
        right = np.pad(right, (0, max(0, j + len(split.remainder) - len(right))))
        right[j : j + len(split.remainder)] += split.remainder
        left = np.pad(np.asarray(plant.c), (0, len(right) - len(plant.c)))
        np.testing.assert_allclose(right, left, atol=1e-9)  # coefficients grow to about 1e2


def test_gain_of_camacho_and_bordons():
    law = GPC(n2=3, weight=0.8).build(THESIS)
    np.testing.assert_allclose(law.gain, [0.133391, 0.285917, 0.147106], atol=1e-6)


@pytest.mark.parametrize("preview", [True, False])
def test_cost_converges_with_the_horizon(preview):
    # Figure 2.9, a step of the reference at t = 5.
    reference = np.concatenate([np.zeros(5), np.ones(80)])
    cost = {
        n: gpc_loop(
            GPC(n2=n, weight=0.8).build(THESIS),
            CarimaPlant(THESIS),
            reference,
            50,
            preview=preview,
        ).cost
        for n in (1, 2, 3, 5, 10, 30)
    }
    assert cost[5] <= 1.002 * cost[30]
    assert cost[10] <= 1.0001 * cost[30]
    assert cost[1] > 1.5 * cost[30]
    assert cost[1] > cost[2] > cost[3] > cost[30]


# -- prediction -----------------------------------------------------------------------------


def test_prediction_is_what_the_plant_does(plant):
    # Past and future of one simulation without noise: free plus forced response is the future.
    rng = np.random.default_rng(5)
    u, t, n2 = rng.normal(size=30), 20, 8
    y = plant.simulate(u)
    prediction = GPC(n2=n2, n1=1, nu=n2 - plant.delay).build(plant).prediction
    increments = np.diff(u[t - 1 :])[: prediction.nu]
    past = np.concatenate([[0.0], u[:t]])  # at rest before: nothing for 1/C to forget
    predicted = prediction.forced @ increments + prediction.free(y[: t + 1], past)
    np.testing.assert_allclose(predicted, y[t + 1 : t + 1 + n2], atol=1e-10)


def test_one_step_error_is_the_noise(plant):
    rng = np.random.default_rng(7)
    u, e = rng.normal(size=600), 0.3 * rng.normal(size=601)
    y = plant.simulate(u, noise=e)
    prediction = GPC(n2=plant.delay + 1, n1=1).build(plant).prediction
    times = range(60, 600)
    # The input of time t reaches y(t + 1) only without dead time: add what it does.
    error = np.array(
        [
            y[t + 1]
            - prediction.free(y[: t + 1], u[:t])[0]
            - prediction.forced[0, 0] * (u[t] - u[t - 1])
            for t in times
        ]
    )
    # The filter 1/C forgets its start like 0.447^t.
    np.testing.assert_allclose(error, e[61:601], atol=1e-8)
    assert np.var(error) == pytest.approx(0.09, rel=0.15)


def test_ignoring_the_colour_predicts_worse():
    rng = np.random.default_rng(8)
    u, e = np.zeros(600), rng.normal(size=601)
    y = COLOURED.simulate(u, noise=e)
    white = replace(COLOURED, c=(1.0,))

    def variance(model: Carima) -> float:
        prediction = GPC(n2=2, n1=1).build(model).prediction
        errors = [y[t + 1] - prediction.free(y[: t + 1], u[:t])[0] for t in range(60, 600)]
        return float(np.var(errors))

    assert variance(COLOURED) < 0.9 * variance(white)


# -- the same as an optimal control problem -------------------------------------------------


@pytest.mark.parametrize("solver", [MultipleShooting(), LinearMPC()], ids=["shooting", "qp"])
def test_law_equals_the_problem(plant, solver):
    y, u, w = measured()
    move = GPC(n2=6, weight=0.8).build(plant).step(y, u, w)
    solution = solve(as_problem(plant, 6), solver).or_raise()
    scale = np.abs(move.increments).max()
    plan = solution.u[: len(move.increments), 0]
    assert np.abs(plan - move.increments).max() <= SAME * scale
    assert np.abs(solution.u[len(move.increments) :]).max(initial=0.0) <= SAME * scale
    predicted = solution.x[plant.delay + 1 :, 0]
    assert np.abs(predicted - move.outputs).max() <= SAME * (1.0 + np.abs(predicted).max())


def test_law_equals_the_problem_with_bounds(plant):
    y, u, w = measured()
    bounds: dict[str, Any] = {"increment_bounds": Box(-1.0, 1.0), "input_bounds": Box(-1.5, 1.5)}
    move = GPC(n2=6, weight=0.8, **bounds).build(plant).step(y, u, w)
    problem = as_problem(plant, 6, **bounds)
    solution = solve(problem, LinearMPC()).or_raise()
    assert move.status is Status.SOLVED
    assert np.abs(solution.u[: len(move.increments), 0] - move.increments).max() <= SAME
    shot = solve(problem, MultipleShooting()).or_raise()
    # An interior point stops at 1e-9 in the complementarity, which is 1e-6 in the controls.
    assert np.abs(shot.u[: len(move.increments), 0] - move.increments).max() <= 1e-6


# -- the loop -------------------------------------------------------------------------------


def test_constant_load_leaves_no_error(plant):
    load = np.where(np.arange(120) >= 40, 0.5, 0.0)
    run = gpc_loop(GPC(n2=8, weight=0.8).build(plant), CarimaPlant(plant), 1.0, 120, load=load)
    assert np.abs(run.y[40] - 1.0) <= 1e-4
    assert np.abs(run.y[41:60] - 1.0).max() > 0.05
    assert np.abs(run.y[-1] - 1.0) <= 1e-8


def test_noise_stays_bounded(plant):
    noise = 0.05 * np.random.default_rng(2).normal(size=201)
    law = GPC(n2=8, weight=0.8).build(plant)
    run = gpc_loop(law, CarimaPlant(plant), 0.0, 200, noise=noise)
    assert np.abs(law.poles).max() < 1.0
    assert np.abs(run.y).max() < 2.0


def test_poles_are_those_of_the_loop():
    law = GPC(n2=3, weight=0.8).build(THESIS)
    run = gpc_loop(law, CarimaPlant(THESIS), 1.0, 30)
    errors = np.abs(run.y[10:25] - 1.0)
    rate = np.abs(law.poles).max()
    bound = errors.max() * rate ** (np.arange(15) - 2)
    assert np.all(errors <= bound)


def test_bounds_hold_and_do_not_stop_the_integral_action():
    options = GPC(
        n2=10,
        weight=0.1,
        increment_bounds=Box(-0.15, 0.15),
        input_bounds=Box(-0.1, 0.6),
        output_bounds=Box(upper=1.02),
    )
    run = gpc_loop(options.build(THESIS), CarimaPlant(THESIS), 1.0, 80, load=np.full(80, -0.1))
    assert set(run.statuses) == {Status.SOLVED}
    assert np.abs(run.du).max() <= 0.15 + ROUNDING
    assert run.u.min() >= -0.1 - ROUNDING
    assert run.u.max() <= 0.6 + ROUNDING
    assert run.du.max() == pytest.approx(0.15)
    assert run.y[-1] == pytest.approx(1.0, abs=1e-6)
    # The plant is the model but for the load, which the law sees one step later.
    free = gpc_loop(GPC(n2=10, weight=0.1).build(THESIS), CarimaPlant(THESIS), 1.0, 80)
    assert np.abs(free.du).max() > 0.3


def test_an_output_that_cannot_be_kept_is_named():
    law = GPC(n2=4, increment_bounds=Box(-0.1, 0.1), output_bounds=Box(upper=1.0)).build(THESIS)
    move = law.step([5.0], [0.0], 0.0)
    assert move.status is Status.INFEASIBLE
    assert "output_bounds" in move.message
    assert "steps ahead" in move.message
    assert move.increment == 0.0


def test_increments_stop_after_nu():
    y, u, w = measured()
    move = GPC(n2=9, n1=2, nu=3, weight=0.5).build(THESIS).step(y, u, w)
    assert len(move.increments) == 3
    assert len(move.outputs) == 8


# -- bad input ------------------------------------------------------------------------------


def test_weight_zero():
    with pytest.raises(ProblemError, match=r"unstable.*zero at -1.5"):
        GPC(n2=3, weight=0.0).build(THESIS)
    mild = Carima([1.0, -0.8], [0.6, 0.4])
    law = GPC(n2=3, weight=0.0).build(mild)
    assert np.abs(law.poles).max() < 1.0
    # One increment for many outputs cancels no zero.
    assert np.abs(GPC(n2=8, nu=1, weight=0.0).build(THESIS).poles).max() < 1.0


@pytest.mark.parametrize(
    "bad",
    [
        {"a": [2.0, 1.0], "b": [1.0]},
        {"a": [], "b": [1.0]},
        {"a": [1.0], "b": [0.0, 0.0]},
        {"a": [1.0, np.nan], "b": [1.0]},
        {"a": ["one"], "b": [1.0]},
        {"a": [1.0], "b": [1.0], "delay": -1},
        {"a": [1.0], "b": [1.0], "delay": 0.5},
        {"a": [1.0], "b": [1.0], "c": [1.0, 2.0]},
    ],
    ids=str,
)
def test_bad_polynomials(bad):
    with pytest.raises(ProblemError, match="carima"):
        Carima(**bad)


@pytest.mark.parametrize(
    "bad",
    [
        {"n2": 2},
        {"n2": 5, "n1": 0},
        {"n2": 5, "n1": 6},
        {"n2": 5, "nu": 4},
        {"n2": 5, "nu": 0},
        {"n2": 5.5},
        {"n2": None},
        {"tolerance": 0.0},
        {"weight": -1.0},
        {"weight": np.inf},
        {"weight": "a"},
        {"tolerance": "tight"},
        {"input_bounds": Box(1.0, 0.0)},
        {"backend": "abacus"},
    ],
    ids=str,
)
def test_bad_options(bad):
    with pytest.raises(ProblemError):
        GPC(**bad).build(LATE)


def test_data_that_are_too_short_or_no_numbers():
    law = GPC(n2=5).build(THESIS)
    with pytest.raises(ProblemError, match="reference has 3 entries"):
        law.step([0.0], [0.0], np.zeros(3))
    with pytest.raises(ProblemError, match="outputs"):
        law.step([], [0.0], 0.0)
    with pytest.raises(ProblemError, match="inputs"):
        law.step([0.0], [np.nan], 0.0)
    with pytest.raises(ProblemError, match="not numeric"):
        law.step(["high"], [0.0], 0.0)
    with pytest.raises(ProblemError, match=r"reference has 22 entries, 25"):
        gpc_loop(law, CarimaPlant(THESIS), np.zeros(22), 20)
    with pytest.raises(ProblemError, match="noise has 3"):
        gpc_loop(law, CarimaPlant(THESIS), 0.0, 20, noise=np.zeros(3))
    with pytest.raises(ProblemError, match="reference has 3 entries, 6"):
        carima_ocp(THESIS, reference=np.zeros(3), weight=1.0, steps=5)
    with pytest.raises(ProblemError, match="weight"):
        carima_ocp(THESIS, reference=np.zeros(3), weight=-1.0)
