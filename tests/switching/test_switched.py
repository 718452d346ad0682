"""Switched controls: known optima, bounds, what follows from more intervals, bad input."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ocp import (
    OCP,
    Box,
    Constraint,
    Delay,
    Grid,
    Guess,
    Model,
    Parameter,
    Peak,
    ProblemError,
    Rate,
    UnsupportedProblem,
    evaluate,
)
from ocp.internal import Steps
from solvers import Collocation, MultipleShooting, switched
from solvers.switching.convexified import Convexified
from solvers.switching.modes import Modes, _choices
from solvers.switching.sum_up_rounding import deviation, sum_up_rounding

PREY, PREDATOR, FISHING = (ca.SX.sym(n) for n in ("prey", "predator", "fishing"))
PLACE, SPEED, PUSH, GEAR = (ca.SX.sym(n) for n in ("place", "speed", "push", "gear"))


def fishing(**changes) -> OCP:
    """Bring a lake to rest by fishing or not (Lotka-Volterra)."""
    f = ca.vertcat(
        PREY - PREY * PREDATOR - 0.4 * PREY * FISHING,
        -PREDATOR + PREY * PREDATOR - 0.2 * PREDATOR * FISHING,
    )
    known = {
        "name": "lake",
        "model": Model(name="lake", x=ca.vertcat(PREY, PREDATOR), u=FISHING, f=f),
        "x0": [0.5, 0.7],
        "horizon": 12.0,
        "running_cost": (PREY - 1) ** 2 + (PREDATOR - 1) ** 2,
        "control_bounds": Box(0.0, 1.0),
    }
    return OCP(**(known | changes))


def sampled(**changes) -> OCP:
    """The same in steps of 0.1 s by Euler's rule."""
    whole = fishing()
    x, f = whole.model.x, whole.model.f
    model = replace(whole.model, f=x + 0.1 * f, dt=0.1)
    return fishing(model=model, horizon=120, **changes)


def geared(**changes) -> OCP:
    """Move a mass with one of three gears; the higher ones cost more at speed."""
    model = Model(
        name="car",
        x=ca.vertcat(PLACE, SPEED),
        u=ca.vertcat(PUSH, GEAR),
        f=ca.vertcat(SPEED, GEAR * PUSH),
        u_units=("N", ""),
        u_nominal=[1.0, 2.0],
    )
    known = {
        "name": "car",
        "model": model,
        "x0": [0.0, 0.0],
        "horizon": 2.0,
        "running_cost": PUSH**2 + 2 * GEAR**2 * SPEED**2,
        "control_bounds": Box([-10.0, 1.0], [10.0, 3.0]),
        "constraints": (Constraint("rest", model.x, [1, 0], [1, 0], at="terminal"),),
    }
    return OCP(**(known | changes))


@pytest.fixture(scope="module")
def lake():
    return switched(fishing(), {"fishing": (0, 1)}, MultipleShooting(240))


def test_the_published_relaxed_optimum(lake):
    """A held share costs a little more than the best, 1.34408 [Sager, Bock & Diehl 2012]."""
    assert 0.0 < lake.lower - 1.34408 < 1e-4


def test_the_switching_is_one_and_lies_between_the_bounds(lake):
    assert set(np.unique(lake.solution.u)) == {0.0, 1.0}
    assert lake.solution.problem.name == "lake"
    assert lake.lower <= lake.upper == evaluate(lake.solution).cost
    assert lake.gap == lake.upper - lake.lower < 2e-3
    assert lake.evaluation.violation == 0.0


def test_the_integrals_keep_their_bound(lake):
    assert lake.deviation <= lake.bound == pytest.approx(0.05)
    assert np.allclose(lake.shares.sum(axis=1), 1.0)
    # Of two modes half an interval is what rounding needs.
    assert lake.deviation <= lake.bound / 2 + 1e-12


def test_it_says_so(lake):
    said = str(lake)
    assert f"{lake.switches} switches on 240 intervals cost {lake.upper:.7g}" in said
    assert f"costs less than {lake.lower:.7g}" in said


def test_narrow_intervals_leave_less(lake):
    """To first order in the end; from one grid to the next the gap may grow."""
    coarse = switched(fishing(), {"fishing": (0, 1)}, MultipleShooting(30))
    assert coarse.gap > 8 * lake.gap
    assert coarse.lower >= lake.lower - 1e-9  # its shares are among those of the finer grid


def test_no_switching_of_all_beats_the_lower_bound():
    """By enumeration of all 2^8 switchings on a coarse grid."""
    found = switched(fishing(), {"fishing": (0, 1)}, MultipleShooting(8))
    form = Convexified(found.solution.problem, Modes.of(fishing(), {"fishing": (0, 1)}))
    problem = form.fixed(np.zeros(8, dtype=int), found.solution.fractions, found.solution.x)
    step = problem.functions
    u = np.array([[(k >> i) & 1 for i in range(8)] for k in range(256)], dtype=float).T
    # RK4 by hand, 40 steps an interval, all switchings at once.
    x, cost, h = np.tile(problem.start()[:, None], (1, 256)), np.zeros(256), 12.0 / 8 / 40
    rate = step.rate.map(256)

    def slope(x: np.ndarray, w: np.ndarray) -> np.ndarray:
        dx = np.array(rate(x, np.zeros((0, 256)), np.zeros((1, 256)), w[None, :]))
        return np.vstack([dx, ((x - 1) ** 2).sum(axis=0)])

    for w in u:
        for _ in range(40):
            k1 = slope(x, w)
            k2 = slope(x + h / 2 * k1[:2], w)
            k3 = slope(x + h / 2 * k2[:2], w)
            k4 = slope(x + h * k3[:2], w)
            change = h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            x, cost = x + change[:2], cost + change[2]
    assert found.lower <= cost.min() + 1e-6
    assert found.upper >= cost.min() - 1e-6


def test_controls_without_levels_are_solved_for_again():
    found = switched(geared(), {"gear": (1, 2, 3)}, MultipleShooting(20))
    assert found.solution.status.is_success
    assert set(np.unique(found.solution.u[:, 1])) <= {1.0, 2.0, 3.0}
    assert found.switches > 0
    assert abs(found.gap) < 1e-6  # the relaxed optimum is a switching already
    assert found.evaluation.violation < 1e-4
    assert found.shares.shape == (20, 3)
    assert found.deviation <= found.bound


def test_levels_that_go_together_are_a_constraint_on_them_alone():
    """Two valves of which only one may be open: three modes of four."""
    level, left, right = (ca.SX.sym(n) for n in ("level", "left", "right"))
    tank = OCP(
        name="tank",
        model=Model(name="tank", x=level, u=ca.vertcat(left, right), f=left + 2 * right - 1),
        x0=[1.0],
        horizon=2.0,
        running_cost=(level - 1.2) ** 2,
        constraints=(Constraint("one valve", left + right, upper=1.0),),
    )
    found = switched(tank, {"left": (0, 1), "right": (0, 1)}, MultipleShooting(40))
    assert len(found.modes) == 3
    assert found.solution.u.sum(axis=1).max() == 1.0
    assert found.evaluation.violation == 0.0
    assert 0.0 <= found.gap < 0.02


def test_an_integral_is_convexified_too():
    """At most 1.5 s of fishing."""
    budget = Constraint("budget", FISHING, upper=1.5, at="integral")
    lake = fishing(constraints=(budget,), guess=Guess(x=[[0.5, 0.7], [1, 1]], u=[0.2]))
    found = switched(lake, {"fishing": (0, 1)}, MultipleShooting(60))
    assert found.solution.u.sum() * 0.2 == pytest.approx(1.5, abs=0.2)


def test_discrete_time():
    found = switched(sampled(), {"fishing": (0, 1)}, MultipleShooting())
    assert len(found.chosen) == 120
    assert found.lower <= found.upper < 1.01 * found.lower


def test_a_switching_that_cannot_end_exactly_has_no_upper_bound():
    end = Constraint("rest", ca.vertcat(PREY, PREDATOR), 1.0, 1.0, at="terminal")
    found = switched(fishing(constraints=(end,)), {"fishing": (0, 1)}, MultipleShooting(40))
    assert found.lower > 1.34
    assert found.upper == np.inf
    assert not found.solution.status.is_success
    assert "They violate" in str(found)


@given(
    st.lists(st.lists(st.floats(0.01, 1.0), min_size=3, max_size=3), min_size=1, max_size=30),
    st.floats(0.1, 2.0),
)
def test_sum_up_rounding_keeps_its_bound(weights, stretch):
    shares = np.array(weights)
    shares /= shares.sum(axis=1, keepdims=True)
    widths = 0.1 * (1.0 + stretch * (np.arange(len(shares)) % 2))
    chosen = sum_up_rounding(shares, widths)
    assert deviation(shares, chosen, widths) <= 2 * widths.max() + 1e-12


def test_sum_up_rounding_by_hand():
    """A share of one half: the first mode, then in turns."""
    assert sum_up_rounding(np.full((4, 2), 0.5), np.ones(4)).tolist() == [0, 1, 0, 1]


@pytest.mark.parametrize(
    ("levels", "said"),
    [
        ({}, "levels is empty: name a control"),
        ({"angling": (0, 1)}, "levels of 'angling', which is no control; they are fishing"),
        ({"fishing": (0, 2)}, "the level 2 of 'fishing' is outside its bounds, 0 to 1"),
        ({"fishing": (1,)}, "two different values are needed"),
        ({"fishing": (1, 1)}, "two different values are needed"),
        ({"fishing": ()}, "two different values are needed"),
        ({"fishing": (0, np.nan)}, "no finite numbers"),
        ({"fishing": 1}, "no finite numbers"),
        ({"fishing": ("on", "off")}, "are no numbers"),
        ([("fishing", (0, 1))], "levels is a list, Mapping is needed"),
    ],
)
def test_bad_levels(levels, said):
    with pytest.raises(ProblemError, match=said.split(":")[0]):
        switched(fishing(), levels, MultipleShooting(5))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"rates": (Rate(FISHING, -1, 1),)}, "a Rate of fishing, which jumps"),
        ({"peaks": (Peak("load", FISHING * PREY),)}, "the peak 'load' contains fishing"),
        (
            {"constraints": (Constraint("mixed", FISHING * PREY, upper=1.0),)},
            "the constraint 'mixed' contains fishing",
        ),
    ],
)
def test_terms_without_a_meaning_between_levels(changes, said):
    with pytest.raises(UnsupportedProblem, match=said):
        switched(fishing(**changes), {"fishing": (0, 1)}, MultipleShooting(5))


def test_a_rate_is_one_of_steps():
    """In continuous time the control is no constant in an interval; in steps it is."""
    rate = {"rates": (Rate(PUSH, -5.0, 5.0),)}
    with pytest.raises(UnsupportedProblem, match="with a Rate of push in continuous time"):
        switched(geared(**rate), {"gear": (1, 2)}, MultipleShooting(20))


def test_an_unsolved_relaxed_problem_is_said():
    """No fishing brings back a lake that is to have 50 times its fish at once."""
    full = Constraint("full", PREY, lower=50.0, at="terminal")
    found = switched(fishing(constraints=(full,)), {"fishing": (0, 1)}, MultipleShooting(5))
    said = str(found)
    why = found.relaxed.status.value
    assert f"is not known, the relaxed problem was not solved: {why}" in said
    assert "only nearly" not in said


def test_choices_are_counted_before_they_are_made():
    with pytest.raises(UnsupportedProblem, match=f"{2**40} choices of levels, before"):
        _choices(fishing(), [[0.0, 1.0]] * 40)


def test_steps_have_a_value_for_each_part():
    with pytest.raises(ProblemError, match="steps 'levels': 3 values, 2 are needed"):
        Steps("levels", FISHING, np.array([0.5]), np.zeros((3, 1)))


def test_other_refusals():
    late = sampled(delays=(Delay(FISHING, 2),))
    with pytest.raises(UnsupportedProblem, match="a Delay of fishing"):
        switched(late, {"fishing": (0, 1)}, MultipleShooting())
    never = Constraint("never", FISHING, upper=0.5)
    with pytest.raises(ProblemError, match="leaves 1 of the choices"):
        switched(fishing(constraints=(never,)), {"fishing": (0, 1)}, MultipleShooting(5))
    with pytest.raises(UnsupportedProblem, match="100 choices of levels"):
        switched(fishing(), {"fishing": np.linspace(0, 1, 100)}, MultipleShooting(5))
    with pytest.raises(UnsupportedProblem, match="with blocks"):
        switched(fishing(), {"fishing": (0, 1)}, MultipleShooting(6, blocks=(2, 4)))
    with pytest.raises(ProblemError, match="the solver of a switched problem"):
        switched(fishing(), {"fishing": (0, 1)}, Collocation(5))  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="switched: the problem"):
        switched("lake", {"fishing": (0, 1)}, MultipleShooting(5))  # type: ignore[arg-type]


def test_a_parameter_of_the_name_is_no_trouble():
    scale = ca.SX.sym("scale")
    lake = fishing(parameters=(Parameter("levels", scale, 1.0),), terminal_cost=scale)
    found = switched(lake, {"fishing": (0, 1)}, MultipleShooting(20))
    assert found.solution.parameters["levels"] == 1.0


def test_the_bound_is_that_of_the_widest_interval():
    grid = Grid((0.0, 0.1, 0.5, 0.6, 1.0))
    found = switched(fishing(), {"fishing": (0, 1)}, MultipleShooting(grid))
    assert found.bound == pytest.approx(12.0 * 0.4)
    assert found.deviation <= found.bound
