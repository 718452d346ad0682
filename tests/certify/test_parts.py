"""Each check of a certificate: it holds where it should, and fails where something is wrong."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.cases import LIBRARY
from models.textbook import (
    beam,
    bryson_denham,
    car_minimum_time,
    double_integrator_energy,
    van_der_pol,
)
from ocp import (
    OCP,
    Box,
    Constraint,
    FreeTime,
    Measurement,
    Model,
    Signal,
    Unknown,
    evaluate,
    solve,
)
from solvers import (
    Certificate,
    CertifyOptions,
    Collocation,
    MultipleShooting,
    certify,
    polish,
)
from solvers.certify.certificate import AGREEMENT, Check, Estimate, Verdict, agreement
from solvers.certify.estimates import extrapolated
from solvers.certify.global_evidence import convexity, other_data
from solvers.certify.grid_conditions import grid_checks
from solvers.certify.hamiltonian_check import hamiltonian_check

LIMIT = 1e-6


def integrator(
    running=lambda x, u: u**2,
    ends=lambda x: (Constraint("end", x, 0.0, 0.0, at="terminal"),),
    control_bounds=None,
    horizon: float | FreeTime = 1.0,
) -> OCP:
    """x' = u from 1 in 1 s; as it stands, int u^2 with x(1) = 0: u = -1."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    return OCP(
        name="integrator",
        model=Model(name="integrator", x=x, u=u, f=u),
        x0=[1.0],
        horizon=horizon,
        running_cost=running(x, u),
        constraints=ends(x),
        control_bounds=control_bounds or Box(),
    )


def free(x):
    """No constraint at the end."""
    return ()


def direct(ocp: OCP, intervals: int = 20):
    return solve(ocp, MultipleShooting(intervals)).or_raise()


@pytest.mark.parametrize(
    ("one", "other", "digits"), [(1.0, 1.0, 16), (2.0, 2.0 + 2e-8, 8), (0.0, 1e-5, 5)]
)
def test_agreement_counts_digits(one, other, digits):
    assert agreement(one, other) == pytest.approx(digits, abs=1e-6)


def test_a_number_that_is_not_one_fails():
    assert Check.at_most("x", np.nan, 1.0, "").verdict is Verdict.FAILS
    assert agreement(np.nan, 1.0) == agreement(1.0, np.nan) == agreement(np.inf, np.inf) == 0.0


# -- extrapolation -------------------------------------------------------------------------


@given(
    st.floats(-100, 100),
    st.floats(0.1, 10),
    st.floats(1.0, 4.0) | st.sampled_from([2.0, 4.0]),
    st.sampled_from([-1.0, 1.0]),
)
def test_extrapolation_finds_the_limit_of_a_power(limit, size, order, sign):
    costs = limit + sign * size * 2.0 ** (-order * np.arange(4))
    found, error, _ = extrapolated(costs)
    assert found == pytest.approx(limit, abs=1e-9 * (1 + abs(limit) + size))
    if order in (2.0, 4.0):
        assert error <= 1e-9 * (1 + abs(limit) + size)


@pytest.mark.parametrize(
    "costs", [(1.0, 1.0, 1.0, 1.0), (1.0, 2.0, 1.0, 2.0), (4.0, 3.0, 2.0, 1.0)]
)
def test_without_a_steady_order_the_last_cost_stands_with_its_change(costs):
    found, error, said = extrapolated(np.array(costs))
    assert found == costs[-1]
    assert error == abs(costs[-1] - costs[-2])
    assert "no steady order" in said


@pytest.mark.parametrize(
    "costs", [(1.0, 2.0, 1.0, 1.5), (0.0, 5e-3, 5e-3, 5e-3 + 1e-9), (8.0, 4.0, 2.0, 1.0)]
)
def test_differences_without_a_smooth_order_count_in_full(costs):
    """A difference that happens to be small does not make the error small."""
    found, error, _ = extrapolated(np.array(costs))
    steps = np.abs(np.diff(costs))
    assert error >= steps[-2:].max()
    assert found - error <= costs[-1] <= found + error


BANG_BANG = (
    "double-integrator-minimum-time",
    "double-integrator-fuel",
    "exponential-fuel",
    "exponential-minimum-time",
    "turnpike",
    "fuller",
)


@pytest.mark.over_library
@pytest.mark.slow
@pytest.mark.parametrize("intervals", [10, 15])
@pytest.mark.parametrize("name", BANG_BANG)
def test_the_error_bar_of_doubled_grids_covers_the_closed_form(name, intervals):
    """Where in its interval a switch lies changes from grid to grid, and no power is seen."""
    case = next(case for case in LIBRARY if case.name == name)
    answer, costs = direct(case.build(), intervals), []
    for doubled in (1, 2, 4, 8):
        answer = solve(answer.problem, MultipleShooting(intervals * doubled), guess=answer)
        costs.append(evaluate(answer.or_raise(), tolerance=1e-11).cost)
    found, error, _ = extrapolated(np.array(costs))
    barrier = MultipleShooting().tolerance * len(answer.t)
    assert case.reference is not None
    assert abs(found - case.reference.value) <= max(error, barrier)


# -- Hamiltonian ---------------------------------------------------------------------------


def test_the_hamiltonian_of_an_extremal_is_constant_and_of_another_trajectory_is_not():
    extremal = polish(direct(van_der_pol(), 75))
    assert hamiltonian_check(extremal, LIMIT).verdict is Verdict.HOLDS
    turned = extremal.with_(costate=1.01 * extremal.costate)
    assert hamiltonian_check(turned, LIMIT).verdict is Verdict.FAILS


def test_time_in_the_problem_is_taken_off():
    x, u, t = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("t")
    ocp = OCP(
        name="aging",
        model=Model(name="aging", x=x, u=u, t=t, f=u),
        x0=[1.0],
        horizon=1.0,
        running_cost=(1 + t) * u**2,
        constraints=(Constraint("end", x, 0.0, 0.0, at="terminal"),),
    )
    extremal = polish(direct(ocp))
    check = hamiltonian_check(extremal, LIMIT)
    assert check.verdict is Verdict.HOLDS
    assert "with the time" in check.sentence


def test_at_a_free_final_time_the_hamiltonian_is_zero():
    ocp = integrator(horizon=FreeTime(1.0, 0.1, 10.0), running=lambda x, u: 1 + u**2)
    extremal = polish(direct(ocp))
    assert extremal.duration == pytest.approx(1.0, abs=1e-8)
    assert hamiltonian_check(extremal, LIMIT).verdict is Verdict.HOLDS
    shifted = extremal.with_(costate=extremal.costate * 1.001)
    assert hamiltonian_check(shifted, LIMIT).verdict is Verdict.FAILS


def test_the_hamiltonian_is_zero_at_a_free_final_time_with_time_in_the_cost_too():
    x, u, t = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("t")
    ocp = OCP(
        name="hurry",
        model=Model(name="hurry", x=x, u=u, t=t, f=u),
        x0=[1.0],
        horizon=FreeTime(1.0, 0.1, 10.0),
        running_cost=(1 + t) * (1 + u**2),
        constraints=(Constraint("end", x, 0.0, 0.0, at="terminal"),),
    )
    extremal = polish(direct(ocp))
    check = hamiltonian_check(extremal, LIMIT)
    assert check.verdict is Verdict.HOLDS
    assert "H = 0" in check.sentence
    shifted = extremal.with_(costate=extremal.costate * 1.001)
    assert hamiltonian_check(shifted, LIMIT).verdict is Verdict.FAILS


def test_at_the_bound_of_a_final_time_the_hamiltonian_is_constant_but_not_zero():
    """Not slower than in half a second: H = 1 - u^2 = -3 with u = -2."""
    ocp = integrator(horizon=FreeTime(0.4, 0.1, 0.5), running=lambda x, u: 1 + u**2)
    check = hamiltonian_check(direct(ocp), LIMIT)
    assert check.verdict is Verdict.HOLDS
    assert "constant" in check.sentence


def test_a_signal_and_a_moving_constraint_are_not_checked():
    x, u, t, w = (ca.SX.sym(name) for name in "xutw")
    moving = Constraint("moving", x - t, -5.0, 5.0)
    model = Model(name="m", x=x, u=u, t=t, f=u)
    parts = {"name": "m", "model": model, "x0": [1.0], "horizon": 1.0}
    tracked = OCP(
        **parts,
        running_cost=u**2 + (x - w) ** 2,
        parameters=(Signal("w", w, np.linspace(0, 1, 5)),),
    )
    walled = OCP(**parts, running_cost=u**2 + x**2, constraints=(moving,))
    for ocp, word in ((tracked, "'w'"), (walled, "'moving'")):
        check = hamiltonian_check(direct(ocp), LIMIT)
        assert check.verdict is Verdict.NOT_CHECKED
        assert word in check.sentence


def test_a_bound_that_the_end_implies_does_not_spoil_the_last_costate():
    """The beam ends at 0, its lowest position: the multipliers of the two are any."""
    answer = solve(beam(), Collocation(intervals=30)).or_raise()
    np.testing.assert_allclose(answer.costate[-1], [-400.0 / 9.0, 40.0 / 3.0], rtol=1e-2)
    # This mesh sees the jumps of the costate at 0.3 and 0.7 to 3e-3.
    assert hamiltonian_check(answer, 1e-2).verdict is Verdict.HOLDS


# -- conditions on a grid ------------------------------------------------------------------


@pytest.mark.parametrize(
    "build", [double_integrator_energy, bryson_denham, van_der_pol, car_minimum_time]
)
def test_the_grid_conditions_hold_at_an_optimum(build):
    assert all(check.verdict is Verdict.HOLDS for check in grid_checks(direct(build())))


@pytest.mark.parametrize("metre", [1.0, 1e-4])
def test_neither_time_units_nor_sizes_decide_on_the_grid(metre):
    """A car over 1000 m in the least time, some 36 s, in metres and in units of 10 km."""
    place, speed, force = (ca.SX.sym(name) for name in ("place", "speed", "force"))
    thrust = (force - 2 * (speed / metre) ** 2) / 500
    drive = OCP(
        name="drive",
        model=Model(
            name="car", x=ca.vertcat(place, speed), u=force, f=ca.vertcat(speed, metre * thrust)
        ),
        x0=[0, 0],
        horizon=FreeTime(30.0),
        running_cost=1,
        control_bounds=Box(-2500, 2500),
        constraints=(
            Constraint("there", place, 1000 * metre, 1000 * metre, at="terminal"),
            Constraint("at rest", speed, 0, 0, at="terminal"),
        ),
    )
    for check in grid_checks(direct(drive)):
        assert check.verdict is Verdict.HOLDS, check


def test_a_trajectory_that_is_not_optimal_is_seen():
    best = direct(integrator())
    bent = best.u + 0.05 * np.sin(2 * np.pi * best.t[:-1])[:, None]
    states = np.concatenate([[1.0], 1.0 + np.cumsum(bent[:, 0]) / len(bent)])[:, None]
    check = grid_checks(best.with_(u=bent, x=states))[1]
    assert check.verdict is Verdict.FAILS


def test_a_multiplier_of_the_wrong_sign_is_named():
    """Held at its bound against the slope of the cost."""
    unbounded = integrator(ends=free, running=lambda x, u: x**2 + u**2)
    bounded = integrator(
        ends=free,
        running=lambda x, u: x**2 + u**2,
        control_bounds=Box([-10.0], [0.5]),
    )
    best = direct(unbounded)
    u = np.full_like(best.u, 0.5)
    x = np.concatenate([[1.0], 1.0 + np.cumsum(u[:, 0]) / len(u)])[:, None]
    check = grid_checks(best.with_(problem=bounded, u=u, x=x))[1]
    assert check.verdict is Verdict.FAILS
    assert "bound of u" in check.sentence


def test_a_constraint_written_twice_fails_licq_but_not_optimality():
    twice = integrator(
        ends=lambda x: (
            Constraint("end", x, 0.0, 0.0, at="terminal"),
            Constraint("end again", 2 * x, 0.0, 0.0, at="terminal"),
        )
    )
    dependent, multipliers, curvature = grid_checks(direct(twice))
    assert dependent.verdict is Verdict.FAILS
    assert not curvature.decisive
    assert not dependent.decisive
    assert "end" in dependent.sentence
    assert multipliers.verdict is Verdict.HOLDS


def test_a_maximum_curves_the_wrong_way():
    """u = 0 is a stationary point of -u^2/2 + u^4/4, and a maximum."""
    ocp = integrator(ends=free, running=lambda x, u: -(u**2) / 2 + u**4 / 4)
    best = direct(ocp)
    still = best.with_(u=np.zeros_like(best.u), x=np.ones_like(best.x))
    _, multipliers, curvature = grid_checks(still)
    assert multipliers.verdict is Verdict.HOLDS
    assert curvature.verdict is Verdict.FAILS


@pytest.mark.parametrize(("sign", "verdict"), [(-1, Verdict.NOT_CHECKED), (1, Verdict.HOLDS)])
def test_a_maximum_at_a_bound_without_a_multiplier_does_not_hold(sign, verdict):
    """u = 0 on 0 <= u <= 1: the cost of -u^2 is largest there, its gradient vanishes."""
    box = Box([0.0], [1.0])
    ocp = integrator(ends=free, running=lambda x, u: sign * u**2, control_bounds=box)
    best = direct(integrator(ends=free))
    still = best.with_(problem=ocp, u=np.zeros_like(best.u), x=np.ones_like(best.x))
    _, multipliers, curvature = grid_checks(still)
    assert multipliers.verdict is Verdict.HOLDS
    assert curvature.verdict is verdict


# -- the whole -----------------------------------------------------------------------------


def test_convexity_is_seen_and_its_absence_named():
    assert convexity(double_integrator_energy()).verdict is Verdict.HOLDS
    check = convexity(van_der_pol())
    assert check.verdict is Verdict.NOT_CHECKED
    assert "not linear" in check.sentence


def test_a_cost_that_only_its_samples_make_convex_is_not():
    """int x^2 - 1e-4 u^2 has no bottom: fast controls pay and move nothing."""
    ocp = integrator(ends=free, running=lambda x, u: x**2 - 1e-4 * u**2)
    check = convexity(ocp)
    assert check.verdict is Verdict.NOT_CHECKED
    assert "concave" in check.sentence


def test_another_start_than_the_problem_s_is_noticed():
    ocp = integrator()
    assert other_data(direct(ocp)) == ""
    elsewhere = MultipleShooting(20).build(ocp).run(x0=[2.0])
    assert "start" in other_data(elsewhere)


@pytest.mark.parametrize(("verdict", "holds"), [(Verdict.HOLDS, True), (Verdict.FAILS, False)])
def test_a_derivation_that_agrees_stands_for_the_second_method(verdict, holds):
    best = Estimate("one", 1.0, 1e-9, 0.0, direct(integrator()), "")
    alone = Certificate("x", (best, best), (Check(AGREEMENT, Verdict.FAILS, ""),))
    assert not alone.holds
    assert alone.beside(Check("closed form", verdict, "")).holds is holds


@pytest.mark.slow
def test_data_at_many_instants_are_nodes_of_every_mesh():
    """More of them than the first mesh of collocation would have intervals."""
    x, k, times = ca.SX.sym("x"), ca.SX.sym("k"), np.arange(1.0, 13.0) / 13.0
    seen = np.exp(-times) + 0.01 * (-1.0) ** np.arange(12)
    ocp = OCP(
        name="decay",
        model=Model(name="decay", x=x, u=ca.SX(0, 1), f=-k * x),
        x0=[1.0],
        horizon=1.0,
        unknowns=(Unknown("rate", k, 0.7, 0.0, 5.0),),
        data=(Measurement("seen", x, times, seen),),
    )
    certificate = certify(direct(ocp, 26), CertifyOptions(intervals=26, starts=1))
    assert any("collocation" in e.method for e in certificate.estimates)
