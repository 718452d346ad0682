"""Least squares at instants: every method, the referee, costates, and bad input."""

import pickle

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from ocp import (
    MPC,
    OCP,
    FreeTime,
    Grid,
    Measurement,
    Model,
    Parameter,
    ProblemError,
    Signal,
    Solution,
    Unknown,
    UnsupportedProblem,
    costates_along,
    evaluate,
    solve,
)
from solvers import Collocation, MultipleShooting, certify, polish

X, K, P = ca.SX.sym("x"), ca.SX.sym("k"), ca.SX.sym("p")
TIMES = np.array([0.0, 0.3, 0.7, 1.1, 1.9, 2.4, 3.0])
NOISE = 0.01 * np.array([1.6, -0.7, 0.0, -1.1, 2.3, -0.4, 0.9])
VALUES = 2.0 * np.exp(-0.8 * TIMES) + NOISE
VALUES[2] = np.nan
RATE = Unknown("rate", K, 0.3, 0.0, 5.0)


def decay(**changes) -> OCP:
    given = {
        "name": "decay",
        "model": Model(name="decay", x=X, u=ca.SX(0, 1), f=-K * X),
        "x0": [1.0],
        "horizon": 3.0,
        "free_start": ("x",),
        "unknowns": (RATE,),
        "data": (Measurement("amount", X, TIMES, VALUES, 0.01),),
    }
    return OCP(**(given | changes))


def closed_form() -> tuple[np.ndarray, float]:
    """Rate, start and cost by least squares on the closed form."""
    known = np.isfinite(VALUES)

    def residuals(q):
        return (q[1] * np.exp(-q[0] * TIMES[known]) - VALUES[known]) / 0.01

    found = least_squares(residuals, [0.3, 1.0], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return found.x, 2 * found.cost


@pytest.mark.many
@pytest.mark.parametrize(
    ("solver", "accuracy"),
    [
        (MultipleShooting(120), 1e-6),
        (MultipleShooting(120, backend="fatrop"), 1e-6),
        (MultipleShooting(Grid.uniform(120)), 1e-6),
        (Collocation(12), 1e-9),
    ],
    ids=["ipopt", "fatrop", "grid", "collocation"],
)
def test_a_decay_is_estimated(solver, accuracy):
    (rate, start), cost = closed_form()
    found = solve(decay(), solver).or_raise()
    assert found.unknowns["rate"][0] == pytest.approx(rate, rel=accuracy)
    assert found.x[0, 0] == pytest.approx(start, rel=accuracy)
    assert found.cost == pytest.approx(cost, rel=100 * accuracy)
    assert evaluate(found).cost == pytest.approx(cost, rel=100 * accuracy)
    residuals = found.residuals["amount"]
    assert residuals.shape == (7, 1)
    assert np.isnan(residuals[2, 0])
    assert np.nansum(residuals**2) == pytest.approx(found.cost)


@pytest.mark.slow
def test_an_estimate_is_an_extremal_that_can_be_certified():
    (rate, _), cost = closed_form()
    exact = polish(solve(decay(), MultipleShooting(40))).or_raise()
    assert exact.cost == pytest.approx(cost, rel=1e-9)
    assert exact.unknowns["rate"][0] == pytest.approx(rate, rel=1e-10)
    certificate = certify(exact)
    assert certificate.holds, str(certificate)


# -- with a control -----------------------------------------------------------------------------

Z, U = ca.SX.sym("z", 2), ca.SX.sym("u")
CART = Model(name="cart", x=Z, u=U, f=ca.vertcat(Z[1], U - ca.sin(Z[0])))
SEEN = (
    Measurement("place", Z[0] + 0.1 * Z[0] ** 2, [0.0, 0.5, 1.1, 2.0], [0.2, 0.9, 0.2, 0.5], 0.2),
    Measurement("both", Z, [0.5, 1.7], [[0.6, np.nan], [0.3, 1.0]], [0.5, 1.0]),
)


def cart(**changes) -> OCP:
    given = {
        "name": "cart",
        "model": CART,
        "x0": [0.0, 0.0],
        "horizon": 2.0,
        "running_cost": U**2,
        "terminal_cost": Z[1] ** 2,
        "data": SEEN,
    }
    return OCP(**(given | changes))


def by_hand(x0, intervals: int = 200) -> float:
    """Multiple shooting of the cart in CasADi's Opti, the squares at its nodes."""
    opti, h = ca.Opti(), 2.0 / intervals
    x, u = opti.variable(2, intervals + 1), opti.variable(intervals)
    rate, cost = ca.Function("rate", [Z, U], [CART.f]), x[1, -1] ** 2
    opti.subject_to(x[:, 0] == x0)
    for k in range(intervals):
        k1 = rate(x[:, k], u[k])
        k2 = rate(x[:, k] + h / 2 * k1, u[k])
        k3 = rate(x[:, k] + h / 2 * k2, u[k])
        k4 = rate(x[:, k] + h * k3, u[k])
        opti.subject_to(x[:, k + 1] == x[:, k] + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
        cost += h * u[k] ** 2
    for m in SEEN:
        read = ca.Function("read", [Z], [m.expression])
        for t, values, sigma in zip(*map(np.asarray, (m.times, m.values, m.sigma)), strict=True):
            seen = read(x[:, round(t / h)])
            for i in np.flatnonzero(np.isfinite(values)):
                cost += ((seen[int(i)] - values[i]) / sigma[i]) ** 2
    opti.minimize(cost)
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "tol": 1e-12})
    return float(opti.solve().value(cost))


@pytest.mark.slow
def test_the_optimum_is_that_of_a_program_with_squares_at_its_nodes():
    """The integral of the change of a square is that change to the fourth order of the grid."""
    found = solve(cart(), MultipleShooting(200)).or_raise()
    assert found.cost == pytest.approx(by_hand([0.0, 0.0]), rel=1e-8)


def test_three_methods_agree_on_cost_and_costates_that_jump():
    direct = solve(cart(), MultipleShooting(200)).or_raise()
    collocated = solve(cart(), Collocation(20, degree=5)).or_raise()
    exact = polish(direct).or_raise()
    assert collocated.cost == pytest.approx(exact.cost, rel=1e-8)
    assert direct.cost == pytest.approx(exact.cost, rel=1e-3)
    assert evaluate(exact).cost == pytest.approx(exact.cost, rel=1e-8)
    for t in (0.0, 0.5, 1.1, 1.7, 2.0):  # just before the data, also where they are at the end
        expected = exact.costate_at(t)
        np.testing.assert_allclose(collocated.costate_at(t), expected, atol=2e-5)
        np.testing.assert_allclose(direct.costate_at(t), expected, atol=2e-2)
    jump = exact.costate_at(0.5) - exact.costate_at(0.5 + 1e-6)
    x = exact.state(0.5)
    place = 2 * (x[0] + 0.1 * x[0] ** 2 - 0.9) * (1 + 0.2 * x[0]) / 0.2**2
    assert jump[0] == pytest.approx(place + 2 * (x[0] - 0.6) / 0.5**2, rel=1e-4)
    assert jump[1] == pytest.approx(0.0, abs=1e-4)
    again = costates_along(direct)
    np.testing.assert_allclose(again.costate, direct.costate, atol=2e-2)


def test_the_first_costate_is_the_slope_of_the_optimal_cost():
    program, step = Collocation(20).build(cart()), 1e-4
    for i in range(2):
        low, high = (program.run(x0=sign * step * np.eye(2)[i]).cost for sign in (-1, 1))
        slope = (high - low) / (2 * step)
        assert program.run().costate[0, i] == pytest.approx(slope, rel=1e-5)


def test_steps_have_their_squares_in_discrete_time():
    step = Model(name="steps", x=Z, u=U, dt=0.5, f=ca.vertcat(Z[0] + 0.5 * Z[1], Z[1] + 0.5 * U))
    seen = Measurement("place", Z[0], [0.5, 1.5, 2.0], [0.5, 0.2, 1.0], [[0.1], [0.2], [0.3]])
    ocp = cart(model=step, horizon=4, data=(seen,))
    found = solve(ocp, MultipleShooting()).or_raise()
    u, x, cost = ca.SX.sym("u", 4), ca.DM.zeros(2), 0
    for k in range(5):
        for t, y, sigma in ((0.5, 0.5, 0.1), (1.5, 0.2, 0.2), (2.0, 1.0, 0.3)):
            cost += ((x[0] - y) / sigma) ** 2 if k == t / 0.5 else 0
        if k < 4:
            cost, x = cost + u[k] ** 2, ca.vertcat(x[0] + 0.5 * x[1], x[1] + 0.5 * u[k])
    cost += x[1] ** 2
    hessian, gradient = ca.hessian(cost, u)
    least = -ca.solve(ca.evalf(hessian), ca.evalf(ca.substitute(gradient, u, ca.DM.zeros(4))))
    value = float(ca.evalf(ca.substitute(cost, u, least)))
    assert found.cost == pytest.approx(value, rel=1e-10)
    assert evaluate(found).cost == pytest.approx(value, rel=1e-10)
    np.testing.assert_allclose(found.u.ravel(), np.array(least).ravel(), atol=1e-8)


def test_perfect_data_leave_nothing_and_that_is_no_fault():
    perfect = Measurement("amount", X, TIMES, 2.0 * np.exp(-0.8 * TIMES))
    found = solve(decay(data=(perfect,)), MultipleShooting(40))
    assert found.status.is_success, found.message
    assert found.cost < 1e-10
    assert found.unknowns["rate"][0] == pytest.approx(0.8, rel=1e-5)


@pytest.mark.slow
def test_a_parameter_and_a_constant_of_the_sensor_are_in_what_is_measured():
    offset = ca.SX.sym("offset")
    data = Measurement("amount", P * X + offset, TIMES, 3 * (2 * np.exp(-0.8 * TIMES)) + 0.4)
    ocp = decay(
        data=(data,),
        unknowns=(RATE, Unknown("offset", offset, 0.0)),
        parameters=(Parameter("gain", P, 3.0),),
    )
    found = solve(ocp, Collocation(12)).or_raise()
    assert found.unknowns["offset"][0] == pytest.approx(0.4, rel=1e-6)
    other = Collocation(12).build(ocp).run(parameters={"gain": 6.0})
    assert other.x[0, 0] == pytest.approx(1.0, rel=1e-6)


# -- files, copies, text ------------------------------------------------------------------------


def test_a_solution_is_kept_with_its_data(tmp_path):
    ocp = decay()
    found = solve(ocp, MultipleShooting(20)).or_raise()
    file = found.save(tmp_path / "decay.npz")
    again = Solution.load(file, ocp)
    np.testing.assert_array_equal(again.residuals["amount"], found.residuals["amount"])
    other = decay(data=(Measurement("amount", X, TIMES, VALUES + 0.1, 0.01),))
    with pytest.raises(ProblemError, match="data differ"):
        Solution.load(file, other)
    copy = pickle.loads(pickle.dumps(ocp))
    assert solve(copy, MultipleShooting(20)).cost == pytest.approx(found.cost, rel=1e-12)
    assert "least squares of 'amount': x at 7 instants, t = 0 to 3" in ocp.describe()


# -- what is refused ----------------------------------------------------------------------------


def measured(**changes) -> Measurement:
    given = {"name": "amount", "expression": X, "times": TIMES, "values": VALUES}
    return Measurement(**(given | changes))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"name": 3}, "name of a measurement"),
        ({"times": TIMES[::-1]}, "times must increase"),
        ({"times": [0.0, np.nan]}, "no finite instants"),
        ({"times": []}, "no finite instants"),
        ({"values": VALUES[:3]}, r"values have shape \(3, 1\), \(7, 1\) is needed"),
        ({"values": np.full(7, np.nan)}, "row 0 has no value"),
        ({"values": VALUES + np.inf}, "infinite"),
        ({"values": ["a"] * 7}, "not numeric"),
        ({"sigma": 0.0}, "sigma must be positive"),
        ({"sigma": np.nan}, "sigma must be positive"),
        ({"sigma": [1.0, 2.0]}, "sigma has shape"),
        ({"expression": "x"}, "amount"),
    ],
)
def test_measurements_that_are_none(changes, said):
    with pytest.raises(ProblemError, match=said):
        measured(**changes)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"data": (measured(times=TIMES + 0.1),)}, "t = 3.1 s is not within the horizon"),
        ({"data": (measured(times=TIMES - 0.1),)}, "t = -0.1 s is not within the horizon"),
        ({"data": (measured(), measured())}, "two measurements are called 'amount'"),
        ({"data": (measured(expression=P),)}, "amount"),
        ({"data": (measured(expression=K),)}, "it contains no state"),
        ({"data": (3,)}, "an entry of data"),
        ({"horizon": FreeTime(3.0)}, "the final time is free"),
        (
            {
                "data": (measured(expression=X * P),),
                "parameters": (Signal("s", P, [1.0, 2.0]),),
            },
            "amount",
        ),
    ],
)
def test_data_that_do_not_fit_the_problem(changes, said):
    with pytest.raises(ProblemError, match=said):
        decay(**changes)


def test_what_is_no_grid_for_data():
    with pytest.raises(
        ProblemError, match="the 5 instants of its data or constraints need more than 5"
    ):
        solve(decay(), MultipleShooting(5))
    grid = Grid.geometric(20, 1.1)
    with pytest.raises(
        ProblemError, match=r"no node at 0\.1 of the horizon, where there are data or"
    ):
        solve(decay(), MultipleShooting(grid))
    found = solve(decay(), MultipleShooting(grid.with_nodes(TIMES / 3.0))).or_raise()
    assert found.unknowns["rate"][0] == pytest.approx(closed_form()[0][0], rel=1e-4)


def test_a_loop_has_no_data():
    with pytest.raises(UnsupportedProblem, match="'place' are of one horizon"):
        MPC(ocp=cart(), solver=MultipleShooting(20), dt=0.1)


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(st.lists(st.floats(0.0, 3.0), min_size=1, max_size=8, unique=True))
def test_data_at_any_instants_are_an_integral(times):
    """Roll-outs: the cost of the normal form is the sum of squares at the instants."""
    times = np.sort(times)
    times = times[np.diff(times, prepend=-1.0) > 1e-3]
    data = Measurement("amount", X, times, np.ones(len(times)))
    ocp = decay(unknowns=(), data=(data,), model=Model(name="d", x=X, u=ca.SX(0, 1), f=-X))
    found = solve(ocp, Collocation(16))
    x = np.exp(-times)
    start = x.sum() / (x**2).sum()
    assert found.x[0, 0] == pytest.approx(start, rel=1e-6)
    assert found.cost == pytest.approx(((start * x - 1) ** 2).sum(), rel=1e-6, abs=1e-9)
