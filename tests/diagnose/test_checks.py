"""Every check on a small problem whose numbers can be worked out by hand."""

import re
from typing import Any

import casadi as ca
import numpy as np
import pytest

from benchmarks.mistakes import problems as of
from models.shapes import Cuboid, Sphere, distance
from ocp import OCP, Box, Constraint, FreeTime, Guess, Model, Signal
from ocp.problem.run_data import RunData
from solvers import MultipleShooting, diagnose
from solvers.diagnose.cause import Cause
from solvers.diagnose.checks.curvature import curvature
from solvers.diagnose.checks.degrees import degrees
from solvers.diagnose.checks.duplicate import duplicate
from solvers.diagnose.checks.grid import grid
from solvers.diagnose.checks.guess import guess
from solvers.diagnose.checks.influence import influence
from solvers.diagnose.checks.instants import instants
from solvers.diagnose.checks.kink import kink
from solvers.diagnose.checks.not_finite import not_finite
from solvers.diagnose.checks.scaling import scaling
from solvers.diagnose.checks.time_kind import time_kind
from solvers.diagnose.checks.unbounded import unbounded
from solvers.diagnose.checks.unreachable import unreachable
from solvers.diagnose.checks.vacuous import vacuous
from solvers.diagnose.conditioning import conditioning
from solvers.diagnose.diagnose import _BEFORE
from solvers.diagnose.elastic_program import Demand, ElasticProgram
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.subject import DiagnosedProblem
from tests.tolerances import MINIMISER

# What the elastic problem leaves over: IPOPT's 1e-8, and the weight of its tie break.
ELASTIC = 1e-3
X, U = ca.SX.sym("x"), ca.SX.sym("u")


def subject(ocp: OCP, intervals: int = 20) -> DiagnosedProblem:
    data = RunData(ocp.start(), 0.0, ocp.parameter_values())
    return DiagnosedProblem(ocp, data, MultipleShooting(intervals))


def only(check, ocp: OCP) -> Finding:
    (finding,) = check(subject(ocp))
    return finding


@pytest.mark.parametrize("build", [of.cart, of.lander, of.car, of.regulator, of.arm])
def test_silent_where_nothing_is_wrong(build):
    sound = subject(build())
    assert [finding for check in _BEFORE for finding in check(sound)] == []


def test_logarithm_names_state_and_instant():
    """The level falls by 0.5 m/s from 1 m: its logarithm ends at t = 2 s."""
    ocp = of.tank(
        f=lambda s: (s.inflow - 0.5,),
        state_bounds=Box(),
        running_cost=lambda s: ca.log(s.level) ** 2 + 0.1 * s.inflow**2,
    )
    found = only(not_finite, ocp)
    assert (found.cause, found.where) == (Cause.NOT_FINITE, ("level",))
    assert found.instant == pytest.approx(2.0)
    assert "logarithm of level" in found.sentence


def test_slope_of_a_root_is_looked_at_too():
    found = list(not_finite(subject(of.tank(x0=[0.0], state_bounds=Box(0.0, 10.0)))))
    assert found[0].where == ("level",)
    assert found[0].instant == 0.0


def test_degrees_in_the_cost_without_units():
    wanted = {"terminal_cost": lambda s: 10 * (s.angle - 180) ** 2, "units": False}
    found = only(degrees, of.pendulum(**wanted))
    assert found.evidence == pytest.approx(180.0)
    assert "3.14159" in found.sentence


def test_radians_are_not_taken_for_degrees():
    assert not list(degrees(subject(of.pendulum(constraints=of.ends({"angle": 4 * np.pi})))))


def test_rate_for_a_next_state_and_back():
    assert only(time_kind, of.cart(dt=0.05, horizon=40)).cause is Cause.TIME_KIND
    sampled = of.regulator(dt=None, horizon=4.0)
    assert only(time_kind, sampled).cause is Cause.TIME_KIND


def test_a_single_next_state_does_not_fall():
    """Solutions of one differential equation cannot cross, so that x -> x(dt) rises."""
    found = only(time_kind, of.tank(dt=0.1, horizon=50))
    assert (found.cause, found.where) == (Cause.TIME_KIND, ("level",))
    assert found.evidence < 0.0
    sampled = of.tank(dt=0.1, horizon=50, f=lambda s: (s.level + 0.1 * (s.inflow - s.level),))
    assert not list(time_kind(subject(sampled)))


def test_a_signal_goes_by_its_name_and_its_symbol():
    ocp = of.servo(
        running_cost=lambda s: (s.spot / s.wanted - 1) ** 2 + 0.01 * s.voltage**2,
        parameters=lambda s: (
            Signal("reference", s.wanted, np.linspace(1.0, 0.0, 21), hold="linear"),
        ),
    )
    assert only(not_finite, ocp).where == ("reference", "wanted")


def test_constraint_without_a_bound():
    ocp = of.cart(constraints=lambda s: (Constraint("speed", s.velocity),))
    assert only(vacuous, ocp).where == ("speed",)


def test_start_that_violates_by_two_kelvin():
    ocp = of.room(
        x0=[18.0],
        state_bounds=Box(),
        constraints=lambda s: (Constraint("comfort", s.warmth, 20.0, 24.0),),
    )
    found = only(instants, ocp)
    assert found.cause is Cause.START_VIOLATES
    assert found.evidence == pytest.approx(2.0, abs=ELASTIC)
    assert found.unit == "degC"


def test_target_beyond_the_arm():
    """The hand reaches 2 m; L1 over the rows moves the target along one axis."""
    found = only(instants, of.arm(constraints=of.reach((3.0, 0.0))))
    assert found.cause is Cause.CONTRADICTION
    assert found.where == ("target",)
    assert found.evidence == pytest.approx(1.0, abs=1e-2)


def test_contradiction_names_both_sides():
    ocp = of.cart(
        constraints=of.ends({"position": 1.0, "velocity": 3.0}),
        state_bounds=Box([-np.inf, -2.0], [np.inf, 2.0]),
    )
    found = only(instants, ocp)
    assert set(found.where) == {"end velocity", "velocity"}
    assert found.evidence == pytest.approx(1.0, abs=ELASTIC)
    assert found.unit == "m/s"


def test_the_far_side_of_an_obstacle_is_no_contradiction():
    """From the start, no direction in which all violations shrink leads round the disc."""
    assert not list(instants(subject(of.car(guess=None))))


def test_an_end_within_the_obstacle_is_one():
    """(x - 5)^2 + (y - 0.3)^2 = 0.34 at (5.5, 0), and 1 is asked for."""

    def inside(s):
        clear = (s.x - 5.0) ** 2 + (s.y - 0.3) ** 2
        return (*of.ends({"x": 5.5, "y": 0.0})(s), Constraint("obstacle", clear, lower=1.0))

    found = only(instants, of.car(guess=None, constraints=inside))
    assert found.cause is Cause.CONTRADICTION
    assert {"obstacle", "end x", "end y"} <= set(found.where)


def test_control_that_moves_nothing():
    found = only(influence, of.cart(more={"brake": "N"}))
    assert (found.cause, found.where) == (Cause.NO_INFLUENCE, ("brake",))


def test_no_goal_and_unused():
    assert only(influence, of.cart(constraints=())).cause is Cause.NO_GOAL
    idle = of.cart(
        states={"spent": "J"},
        f=lambda s: (s.velocity, s.force / 2, s.force**2),
        x0=[0.0, 0.0, 0.0],
    )
    found = only(influence, idle)
    assert (found.cause, found.severity) == (Cause.UNUSED, Severity.ADVICE)


def test_uncoupled_state_misses_by_what_its_decay_leaves():
    """0.5 exp(-0.1 * 2) = 0.409 m where 1 m is asked."""
    ocp = of.cart(
        states={"wagon": "m"},
        f=lambda s: (s.velocity, s.force / 2, -0.1 * s.wagon),
        x0=[0.0, 0.0, 0.5],
        constraints=of.ends({"position": 1.0, "wagon": 1.0}),
    )
    found = only(unreachable, ocp)
    assert found.where == ("end wagon", "wagon")
    assert found.evidence == pytest.approx(1.0 - 0.5 * np.exp(-0.2), rel=MINIMISER)


def test_uncoupled_state_that_ends_right_is_no_mistake():
    ocp = of.cart(
        states={"clock": "s"},
        f=lambda s: (s.velocity, s.force / 2, 1.0),
        x0=[0.0, 0.0, 0.0],
        constraints=of.ends({"position": 1.0, "clock": 2.0}),
    )
    assert not list(unreachable(subject(ocp)))


@pytest.mark.parametrize(
    ("cost", "cause"),
    [
        (lambda s: 2 * s.force, Cause.LINEAR_COST),
        (lambda s: s.position * s.force, Cause.LINEAR_COST),
        (lambda s: s.position**2, Cause.FREE_CONTROL),
        (lambda s: -(s.force**2), Cause.WRONG_SIGN),
        (lambda s: s.force**2 - s.position**2, Cause.WRONG_SIGN),
    ],
)
def test_costs_without_a_minimum(cost, cause):
    assert only(curvature, of.cart(running_cost=cost, control_bounds=Box())).cause is cause


def test_linear_cost_of_a_bounded_control_is_sound():
    assert not list(curvature(subject(of.room())))


def test_stiffness_says_how_many_steps():
    """A time constant of 1e-4 s over 5 s: 5e4 of them, RK4 takes 2.78 in a step."""
    ocp = of.tank(
        states={"valve": ""},
        f=lambda s: (s.valve - 0.5 * s.level, 1e4 * (s.inflow - s.valve)),
        x0=[1.0, 0.0],
        state_bounds=Box(),
    )
    found = only(grid, ocp)
    assert found.where[0] == "valve"
    assert str(int(np.ceil(5e4 / 2.78))) in found.sentence


def test_the_fastest_motion_names_the_same_states_in_any_unit():
    """A mass of 1 kg on a spring of 10^6 N/m: place and speed move in one motion."""

    def spring(unit: float) -> OCP:
        return of.cart(
            f=lambda s: (s.velocity / unit, unit * (s.force - 1e6 * s.position)),
            constraints=(),
            terminal_cost=lambda s: s.position**2,
        )

    for unit in (1e-3, 1.0, 1e3):
        found = only(grid, spring(unit))
        assert set(found.where) == {"position", "velocity"}
        assert "time constant of 0.001 s" in found.sentence


def test_dependent_ends():
    ocp = of.cart(
        constraints=lambda s: (
            *of.ends({"position": 1.0, "velocity": 0.0})(s),
            Constraint("twice", 2 * s.position, 2.0, 2.0, at="terminal"),
        )
    )
    assert set(only(duplicate, ocp).where) == {"end position", "twice"}


def test_kinks_by_their_order():
    order = {
        "abs": (lambda s: ca.fabs(s.force), 0.0),
        "square of a maximum": (lambda s: ca.fmax(0, s.force) ** 2, 1.0),
        "jump": (lambda s: ca.if_else(s.force > 0, 1.0, 2.0), -1.0),
    }
    for cost, smooth in order.values():
        found = list(kink(subject(of.cart(running_cost=cost))))
        assert found[0].evidence == smooth
        assert found[0].where == ("force",)


def test_kinks_that_are_declared_or_smooth_are_none():
    assert not list(kink(subject(of.cart(running_cost=lambda s: ca.fmax(0, s.force) ** 3))))
    declared = of.cart(running_cost=lambda s: ca.fabs(s.force), smoothness=0)
    assert not list(kink(subject(declared)))


def test_guess_beyond_the_bounds():
    found = only(guess, of.cart(guess=Guess(u=[50.0])))
    assert (found.where, found.evidence) == (("force",), 40.0)


def test_scaling_says_what_to_divide_by():
    ocp = of.cart(
        states={"altitude": "m"},
        f=lambda s: (s.velocity, s.force / 2, 1e3 * s.velocity),
        x0=[0.0, 0.0, 7e6],
    )
    found = only(scaling, ocp)
    assert found.where[0] == "altitude"
    assert "divide altitude by 1e+07" in found.sentence


def test_what_a_choice_of_features_leaves_in_derivatives_is_no_size():
    """The curvature of this distance above a face is 0: what is left of the choice is not."""
    box, ball = Cuboid((10.0, 10.0, 1.0)), Sphere(0.1)

    def cost(s):
        place = ca.vertcat(s.position, s.velocity, 2.0)
        return s.force**2 + (distance(ball.at(place), box) - 1.0) ** 2

    assert not list(scaling(subject(of.cart(running_cost=cost, constraints=()))))


def in_units_of(size: float) -> OCP:
    """The cart, its force in another unit."""
    return of.cart(
        f=lambda s: (s.velocity, s.force * size / 2),
        running_cost=lambda s: (s.force * size) ** 2,
        control_bounds=Box(-10.0 / size, 10.0 / size),
    )


def test_balancing_takes_units_out_of_the_condition_number():
    known = conditioning(subject(in_units_of(1.0)))
    other = conditioning(subject(in_units_of(1e-3)))
    assert known is not None
    assert other is not None
    assert other.raw > 1e3 * known.raw
    assert other.balanced == pytest.approx(known.balanced, rel=0.5)
    assert other.gain > 1e3 * known.gain
    assert other.large == "force"


def test_condition_number_by_hand():
    """One interval of x' = u, both ends given: free are u and nothing else, as x is bounded.

    For x0 = 0, x1 = 1, h = 1 the unknowns x0, x1, u have the rows x0 + u - x1 = 0, x1 = 1, and x0
    sits on its bound; the cost 2 u^2 bends by 4.
    """
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    ocp = OCP(
        name="one interval",
        model=Model(name="integrator", x=x, u=u, f=u),
        x0=[0.0],
        horizon=1.0,
        running_cost=2 * u**2,
        constraints=(Constraint("end", x, 1.0, 1.0, at="terminal"),),
    )
    # Columns x1, u, and the multipliers of dynamics and end; signs do not change it.
    k = np.array([[0, 0, 1, 1], [0, 4, -1, 0], [1, -1, 0, 0], [1, 0, 0, 0]], dtype=float)
    known = conditioning(subject(ocp, intervals=1))
    assert known is not None
    assert known.raw == pytest.approx(np.linalg.cond(k), rel=MINIMISER)


def test_no_condition_number_of_a_failed_trial():
    failed = of.cart(state_bounds=Box([-np.inf, -5.0], [np.inf, 0.0]))
    assert conditioning(subject(failed)) is None


def test_cost_that_falls_without_limit():
    ocp = of.cart(
        running_cost=lambda s: s.force**2 + s.velocity**3, control_bounds=Box(), constraints=()
    )
    assert "velocity" in only(unbounded, ocp).where
    convex = of.cart(running_cost=lambda s: s.force**2 + s.velocity, control_bounds=Box())
    assert not list(unbounded(subject(convex)))


def test_conflict_of_a_line():
    """x >= 1 and x <= 0 exclude each other, y <= 5 has no part in it."""
    w = ca.MX.sym("w", 2)
    elastic = ElasticProgram(
        w=w,
        p=ca.MX(0, 1),
        hard=ca.MX(0, 1),
        rows=ca.vertcat(w[0], w[1], w[0]),
        lower=np.array([1.0, -np.inf, -np.inf]),
        upper=np.array([np.inf, 5.0, 0.0]),
        owner=np.arange(3),
        demands=tuple(Demand((n,), n) for n in ("above", "aside", "below")),
        box=(np.full(2, -np.inf), np.full(2, np.inf)),
    )
    answer = elastic.solve(np.zeros(2), np.empty(0), range(3))
    assert answer.slack.sum() == pytest.approx(1.0, abs=ELASTIC)
    assert elastic.conflict(answer, np.empty(0)) == (0, 2)
    assert elastic.is_possible(elastic.solve(np.zeros(2), np.empty(0), (0, 1)))


def test_out_of_reach_in_numbers():
    """2 kg, 10 N, 0.5 s: a T^2 / 4 = 0.3125 m of 1 m; 32 N, or 2 sqrt(1/5) = 0.894 s, do it."""
    found = diagnose(of.cart(horizon=0.5)).first
    assert found is not None
    assert found.cause is Cause.OUT_OF_REACH
    assert {"end position", "force"} <= set(found.where)
    assert found.evidence == pytest.approx(1.0 - 0.3125, abs=ELASTIC)
    assert found.unit == "m"
    assert found.instant == pytest.approx(0.5)
    assert "would have to give way by 22 N" in found.sentence
    assert "With a horizon of 0.8" in found.sentence


def test_a_speed_limit_is_a_matter_of_time():
    """5 m/s^2 up to 0.4 m/s and down again over 1 m: 1 / 0.4 + 0.4 / 5 = 2.58 s, not 2 s."""
    slow = of.cart(state_bounds=Box([-np.inf, -0.4], [np.inf, 0.4]))
    found = diagnose(slow).first
    assert found is not None
    assert found.cause is Cause.OUT_OF_REACH
    assert {"end position", "velocity"} <= set(found.where)
    told = re.search(r"With a horizon of ([\d.]+) s", found.sentence)
    assert told is not None
    assert float(told[1]) == pytest.approx(2.58, rel=0.01)


@pytest.mark.slow
def test_time_that_vanishes_and_time_without_end():
    shrinking = of.fastest(horizon=FreeTime(2.0), constraints=of.ends({"position": 0.0}))
    assert _first(shrinking) is Cause.VANISHING_TIME
    assert _first(of.cart(horizon=FreeTime(2.0))) is Cause.ENDLESS_TIME


@pytest.mark.slow
def test_a_guess_that_is_too_short_is_no_time_without_end():
    """100 m at 1 m/s^2, there and at rest, take 20 s; the guess is 0.5 s."""
    assert _first(minimum_time(distance=100.0, horizon=FreeTime(0.5, 0.1, 1000.0))) is None


@pytest.mark.many
@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_from_one_bound_to_the_other_is_a_decision_in_any_unit(unit):
    causes = {f.cause for f in diagnose(minimum_time(unit=unit)).findings}
    assert Cause.SATURATED not in causes


@pytest.mark.parametrize("unit", [1.0, 1e6])
def test_full_thrust_all_the_time_is_none_in_any_unit(unit):
    thrust = push(unit, -X, control_bounds=Box(-unit, unit))
    found = [f.evidence for f in diagnose(thrust).findings if f.cause is Cause.SATURATED]
    assert found == pytest.approx([unit])


def test_a_small_unit_is_no_idleness():
    """The regulator moves its control by 1e-6, which is 1 in another unit."""
    regulator = push(1e-6, X**2 + 0.1 * (U / 1e-6) ** 2)
    assert Cause.NO_GOAL not in {f.cause for f in diagnose(regulator).findings}


def push(unit: float, cost: ca.SX, **options: Any) -> OCP:
    mass = Model(name="mass", x=X, u=U, f=U / unit)
    return OCP(name="push", model=mass, x0=[1.0], horizon=2.0, running_cost=cost, **options)


def minimum_time(
    *, distance: float = 1.0, unit: float = 1.0, horizon: FreeTime | None = None
) -> OCP:
    x, v, u = (ca.SX.sym(name) for name in "xvu")
    return OCP(
        name="minimum time",
        model=Model(name="mass", x=ca.vertcat(x, v), u=u, f=ca.vertcat(v, u / unit)),
        x0=[distance, 0.0],
        horizon=horizon or FreeTime(3.0, 0.1, 10.0),
        running_cost=1.0,
        control_bounds=Box(-unit, unit),
        constraints=(Constraint("end", ca.vertcat(x, v), 0.0, 0.0, at="terminal"),),
    )


@pytest.mark.slow
def test_idle_optimum_and_idle_constraint():
    assert _first(of.servo(running_cost=lambda s: s.spot**2 + s.voltage**2)) is Cause.UNUSED
    # The start is the goal.
    assert _first(of.oscillator(x0=[0.0, 0.0])) is Cause.NO_GOAL
    far = of.cart(
        constraints=lambda s: (
            *of.ends({"position": 1.0, "velocity": 0.0})(s),
            Constraint("wall", s.position, upper=100.0),
        )
    )
    assert _first(far) is Cause.INACTIVE


def _first(ocp: OCP) -> Cause | None:
    found = diagnose(ocp).first
    return None if found is None else found.cause


def test_two_controls_and_a_free_start():
    """A start on a circle, an end on it: nothing to complain about."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 2)
    ocp = OCP(
        name="circle",
        model=Model(name="point", x=x, u=u, f=u),
        x0=[1.0, 0.1],
        horizon=1.0,
        running_cost=ca.sumsqr(u),
        terminal_cost=ca.sumsqr(x - ca.DM([3.0, 0.0])),
        constraints=(Constraint("circle", ca.sumsqr(x), 1.0, 1.0, at="initial"),),
    )
    assert not diagnose(ocp, intervals=20).serious
