"""The problem description: what it derives, and every bad input with its message."""

import re
from typing import Any

import casadi as ca
import numpy as np
import pytest

from ocp import OCP, Box, Constraint, FreeTime, Guess, Parameter, ProblemError, Signal
from ocp.problem.run_data import RunData
from solvers import MultipleShooting
from tests.ocp.problems import DURATION, integrator, lag, pendulum

FREE = FreeTime(guess=1.0, lower=0.5, upper=2.0)


def test_numbers_are_checked_and_frozen() -> None:
    ocp = pendulum()
    assert ocp.start().shape == (2,)
    assert ocp.p.numel() == 3
    with pytest.raises(ValueError, match="read-only"):
        ocp.start()[0] = 1.0
    np.testing.assert_array_equal(integrator(x0=0.3).start(), [0.3])


def test_duration_and_steps_follow_the_kind_of_horizon() -> None:
    assert pendulum().duration == DURATION
    assert pendulum().steps is None
    assert lag().duration == pytest.approx(0.4)
    assert lag().steps == 4
    free = integrator(horizon=FREE)
    assert free.has_free_time
    assert free.duration == 1.0
    np.testing.assert_array_equal(free.time_box.upper, [2.0])
    np.testing.assert_array_equal(lag().time_box.lower, lag().time_box.upper)


def test_constraints_are_sorted_by_place() -> None:
    ocp = integrator()
    x, u = ocp.model.x, ocp.model.u
    cs = (
        Constraint("a", x + u, upper=9.0),
        Constraint("b", x, 0.0, 0.0, at="initial"),
        Constraint("c", x, 1.0, 1.0, at="terminal"),
    )
    ocp = integrator_with(ocp, constraints=cs)
    assert [c.name for c in ocp.at("path")] == ["a"]
    assert [c.name for c in ocp.at("initial")] == ["b"]
    assert [c.name for c in ocp.at("terminal")] == ["c"]
    assert ocp.has_free_start


def integrator_with(ocp: OCP, **changes) -> OCP:
    """Return the same model in another problem."""
    given = {"name": "integrator", "model": ocp.model, "x0": 0.0, "horizon": 1.0}
    return OCP(**(given | changes))


X = integrator()
x, u = X.model.x, X.model.u
Y, MX = ca.SX.sym("y"), ca.MX.sym("m")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"x0": [0.0, 1.0]}, ("x0 has 2 entries, 1 are needed",)),
        ({"x0": np.nan}, ("x0[0] is nan",)),
        ({"x0": np.inf}, ("x0[0] is inf",)),
        ({"x0": "here"}, ("x0 is not numeric", "here")),
        ({"running_cost": Y}, ("running_cost contains y",)),
        ({"running_cost": MX}, ("running_cost contains m, unknown",)),
        ({"running_cost": ca.vertcat(x, u)}, ("running_cost has 2 elements",)),
        ({"running_cost": np.nan}, ("running_cost (row 0) is not finite",)),
        ({"running_cost": 1.0 / x}, ("running_cost", "not finite", "singular start")),
        ({"terminal_cost": u**2}, ("terminal_cost contains u", "no controls")),
        ({"terminal_cost": MX}, ("terminal_cost contains m, unknown",)),
        ({"terminal_cost": ca.log(x - 1.0)}, ("terminal_cost (row 0) is not finite",)),
        ({"control_bounds": Box([0.0, 0.0], 1.0)}, ("control_bounds: lower has 2 entries, 1",)),
        ({"control_bounds": Box(1.0, 0.0)}, ("control_bounds[0]", "between 1.0 and 0.0")),
        ({"control_bounds": Box(0.0, np.nan)}, ("control_bounds: upper[0] is nan",)),
        ({"state_bounds": Box(1.0, 2.0)}, ("x0[0] (x) = 0.0 is outside", "[1.0, 2.0]")),
        ({"state_bounds": Box(2.0, 1.0)}, ("state_bounds[0]",)),
        ({"constraints": (Constraint("gap", Y),)}, ("path constraint 'gap' contains y",)),
        (
            {"constraints": (Constraint("gap", x + u, at="terminal"),)},
            ("terminal constraint 'gap' contains u",),
        ),
        (
            {"constraints": (Constraint("gap", u, at="initial"),)},
            ("initial constraint 'gap' contains u",),
        ),
        ({"constraints": (Constraint("c", x), Constraint("c", u))}, ("two constraints", "'c'")),
        (
            {"constraints": (Constraint("c", x),), "invariants": (Constraint("c", x),)},
            ("two constraints are called 'c'",),
        ),
        ({"constraints": (Constraint("far", 1 / x, 0, 1),)}, ("constraints (row 0)",)),
        ({"invariants": (Constraint("i", u),)}, ("invariant 'i' contains u",)),
        ({"invariants": (Constraint("i", x, at="terminal"),)}, ("invariant 'i' must hold",)),
        (
            {"parameters": (Parameter("p", Y, 0.0), Parameter("p", ca.SX.sym("z"), 0.0))},
            ("two parameters are called 'p'",),
        ),
        (
            {"parameters": (Parameter("p", Y, 0.0), Signal("q", Y, [0.0, 1.0]))},
            ("a symbol is declared twice",),
        ),
        ({"parameters": (Parameter("p", x, 0.0),)}, ("a symbol is declared twice",)),
        ({"horizon": 0.0}, ("horizon = 0.0",)),
        ({"horizon": -1.0}, ("horizon = -1.0",)),
        ({"horizon": np.nan}, ("horizon = nan",)),
        ({"horizon": np.inf}, ("horizon = inf",)),
        ({"horizon": "long"}, ("horizon = 'long'",)),
        ({"horizon": None}, ("horizon = None",)),
        ({"smoothness": 3}, ("smoothness = 3",)),
        ({"guess": Guess(x=[0.0, 1.0, 2.0])}, ("guess: x has shape (1, 3)", "(1,)")),
        ({"guess": Guess(u=[[np.nan]])}, ("guess: u is not finite",)),
    ],
)
def test_refuses(changes: dict, words: tuple[str, ...]) -> None:
    with pytest.raises(ProblemError) as caught:
        integrator_with(X, **changes)
    for word in words:
        assert word in str(caught.value)


def test_refuses_foreign_symbols_in_the_dynamics() -> None:
    gain = ca.SX.sym("gain")
    model = pendulum().model
    with pytest.raises(ProblemError, match="model 'pendulum': f contains gain, held"):
        OCP(name="p", model=model, x0=0.0, horizon=1.0, parameters=(Parameter("g", gain, 1.0),))


@pytest.mark.parametrize(
    ("horizon", "words"),
    [
        (2.5, "horizon = 2.5 .* number of steps"),
        (2.0, "horizon = 2.0 .* no duration"),
        (FREE, "discrete-time model has no free final"),
    ],
)
def test_refuses_the_wrong_horizon_of_a_discrete_model(horizon: object, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        lag(horizon=horizon)


def test_takes_a_horizon_from_numpy() -> None:
    assert lag(horizon=np.int64(4)).steps == 4
    assert integrator(horizon=np.float64(2.0)).duration == 2.0


@pytest.mark.parametrize(
    ("guess", "lower", "upper"),
    [(1.0, 2.0, 3.0), (1.0, 0.0, 2.0), (3.0, 1.0, 2.0), (np.nan, 1.0, 2.0), (1.0, np.nan, 2.0)],
)
def test_free_time_refuses(guess: float, lower: float, upper: float) -> None:
    with pytest.raises(
        ProblemError,
        match=r"free final time: (0 < lower <= guess <= upper|(guess|lower) = (0.0|nan))",
    ):
        FreeTime(guess=guess, lower=lower, upper=upper)


def test_a_free_start_may_lie_outside_the_bounds() -> None:
    manifold = Constraint("start", x, 1.5, 1.5, at="initial")
    ocp = integrator_with(X, constraints=(manifold,), state_bounds=Box(1.0, 2.0))
    np.testing.assert_array_equal(ocp.start([0.5]), [0.5])


@pytest.mark.parametrize(
    ("run", "message"),
    [
        ({"x0": [1.0, 2.0, 3.0]}, "pendulum: x0 has 3 entries, 2 are needed"),
        ({"x0": [np.nan, 0.0]}, r"pendulum: x0\[0\] is nan"),
        ({"t0": np.nan}, "t0 = nan"),
        ({"parameters": {"gain": np.nan}}, r"parameter 'gain'\[0\] is nan"),
        ({"parameters": {"gian": 1.0}}, "unknown parameters: gian; declared are: gain, held"),
        ({"parameters": {"held": np.zeros((3, 2))}}, r"signal 'held': samples have shape \(3, 2\)"),
        ({"guess": Guess(u=np.zeros((5, 3)))}, r"guess: u has shape \(5, 3\), \(2,\) or"),
        ({"guess": Guess(x=[np.inf, 0.0])}, "guess: x is not finite"),
    ],
)
def test_a_run_refuses_bad_data(run: dict, message: str) -> None:
    program = MultipleShooting(intervals=3).build(pendulum(state_bounds=Box(-5.0, 5.0)))
    with pytest.raises(ProblemError, match=message):
        program.run(**run)


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf])
def test_a_guess_of_the_duration_is_positive(duration: float) -> None:
    with pytest.raises(ProblemError, match="guess: duration"):
        Guess(duration=duration)


@pytest.mark.parametrize("t0", [np.nan, np.inf])
def test_data_refuses_an_initial_time_that_is_not_finite(t0: float) -> None:
    ocp = integrator()
    with pytest.raises(ProblemError, match=re.escape(f"t0 = {t0}")):
        RunData.of(ocp, t0=t0)


def test_a_guess_is_sampled_at_any_instants() -> None:
    guess = Guess(x=[[0.0, 0.0], [1.0, 2.0]], u=[3.0])
    x: Any = guess.sample("x", np.array([0.0, 0.25, 1.0]), 2)
    u: Any = guess.sample("u", np.array([0.0, 0.9]), 1)
    np.testing.assert_allclose(x, [[0.0, 0.0], [0.25, 0.5], [1.0, 2.0]])
    np.testing.assert_array_equal(u, [[3.0], [3.0]])
    assert guess.sample("costate", np.array([0.0]), 2) is None


def test_a_declared_start_lies_within_its_bounds() -> None:
    bounds = Box(-1.0, 0.3)
    assert integrator(x0=0.3 + 1e-12, state_bounds=bounds).start()[0] == 0.3 + 1e-12
    with pytest.raises(ProblemError, match=r"x0\[0\] .* is outside its bounds"):
        integrator(x0=0.3 + 1e-6, state_bounds=bounds)


def test_a_given_start_may_be_measured_anywhere() -> None:
    """What it means to lie outside the bounds a solution says, such as a direct one."""
    np.testing.assert_array_equal(integrator(x0=0.3, state_bounds=Box(-1.0, 0.3)).start(2.0), [2.0])
