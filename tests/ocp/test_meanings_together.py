"""Where two meanings of the language meet: taken rightly, or refused by name."""

import casadi as ca
import numpy as np
import pytest

from ocp import (
    MPC,
    OCP,
    Constraint,
    Delay,
    Link,
    Measurement,
    Model,
    Peak,
    Phases,
    ProblemError,
    Rate,
    Signal,
    Soft,
    Solution,
    Unknown,
    UnsupportedProblem,
    discretise,
    estimate,
    evaluate,
    linear_quadratic,
    solve,
)
from solvers import Collocation, MultipleShooting

x, u, z, t, k, r = (ca.SX.sym(name) for name in "xuztkr")


def pulled(model: Model | None = None, **changes) -> OCP:
    """dx/dt = u from 0, cost u^2 + (x - 1)^2."""
    given = {
        "name": "pulled",
        "model": model or Model(name="integrator", x=x, u=u, f=u, t=t),
        "x0": [0.0],
        "horizon": 1.0,
        "running_cost": u**2 + (x - 1) ** 2,
    }
    return OCP(**(given | changes))


STEPS = Model(name="steps", x=x, u=u, f=x + u, dt=1.0)


def test_a_constraint_at_an_instant_knows_no_slope_of_a_signal() -> None:
    signal = Signal("reference", r, np.linspace(0, 2, 11))
    at_half = Constraint("meet", x - r, 0, 0, at=0.5)
    with pytest.raises(ProblemError, match=r"'meet'.*signal 'reference'"):
        pulled(constraints=(at_half,), parameters=(signal,))
    through = Model(name="through", x=x, u=u, f=u, z=z, algebraic=z - x + r)
    with pytest.raises(ProblemError, match="signal 'reference'"):
        pulled(through, constraints=(Constraint("meet", z, 0, 0, at=0.5),), parameters=(signal,))


ADDED = {
    "rate": {"rates": (Rate(u, -9, 9),)},
    "peak": {"peaks": (Peak("top", x),)},
    "data": {"data": (Measurement("seen", x, [0.5], [0.2]),)},
    "integral": {"constraints": (Constraint("spent", u**2, upper=9, at="integral"),)},
    "instant": {"constraints": (Constraint("by", x, 0.1, 9, at=0.5),)},
    "free start": {"free_start": ("x",)},
}


@pytest.mark.parametrize("what", ADDED)
def test_a_file_of_one_is_no_file_of_the_plain_problem(what: str, tmp_path) -> None:
    path = solve(pulled(**ADDED[what]), MultipleShooting(10)).save(tmp_path / "s.npz")
    with pytest.raises(ProblemError, match="another 'pulled'"):
        Solution.load(path, pulled())


def test_a_delayed_control_in_algebraic_equations_is_refused() -> None:
    model = Model(name="steps", x=x, u=u, f=x + z, z=z, algebraic=z - u, dt=1.0)
    with pytest.raises(ProblemError, match="Delay of 'u': an algebraic variable depends on it"):
        pulled(model, horizon=5, delays=(Delay(u, 2, [0, 0]),))


def test_a_rate_and_a_delay_of_one_control_say_the_same_of_its_past() -> None:
    both = {"horizon": 5, "delays": (Delay(u, 1, [0.5]),), "rates": (Rate(u, -0.1, 0.1),)}
    with pytest.raises(ProblemError, match=r"newest of its history, 0\.5"):
        pulled(STEPS, **both)
    with pytest.raises(ProblemError, match=r"newest of its history, 0\.5"):
        pulled(STEPS, **both, last_input=[0.0])
    found = solve(pulled(STEPS, **both, last_input=[0.5]), MultipleShooting(5)).or_raise()
    assert 0.4 - 1e-6 < found.u[0, 0] < 0.6 + 1e-6


def test_algebraic_variables_are_discretised_exactly() -> None:
    model = Model(name="lag", x=x, u=u, f=-5 * z + u, z=z, algebraic=z - x)
    step = discretise(pulled(model), 0.1)
    after = ca.Function("after", [x, u], [step.model.f])
    assert float(after(1.0, 0.0)) == pytest.approx(np.exp(-0.5), rel=1e-12)
    linear_quadratic(step)  # it has matrices


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"data": (Measurement("seen", x, [1.0], [0.2]),)}, "measurements"),
        ({"constraints": (Constraint("by", x, 0, 1, at=2.0),)}, "instants"),
    ],
)
def test_matrices_know_nothing_of_instants(changes: dict, said: str) -> None:
    with pytest.raises(UnsupportedProblem, match=said):
        linear_quadratic(pulled(STEPS, horizon=5, **changes))


def test_the_peak_of_a_variable_that_moves_with_the_control_ends_with_the_steps() -> None:
    model = Model(name="steps", x=x, u=u, f=x + u, z=z, algebraic=z - x * u, dt=1.0)
    peaks = {"horizon": 3, "x0": [1.0], "running_cost": (u - 1) ** 2}
    with_z = solve(pulled(model, peaks=(Peak("top", z),), **peaks), MultipleShooting(3))
    plain = solve(pulled(STEPS, peaks=(Peak("top", x * u),), **peaks), MultipleShooting(3))
    assert evaluate(with_z).cost == pytest.approx(evaluate(plain).cost, abs=1e-6)
    assert evaluate(with_z).cost == pytest.approx(with_z.cost, abs=1e-6)


def test_a_loop_takes_a_badly_scaled_problem_with_algebraic_variables() -> None:
    model = Model(name="large", x=x, u=u, f=1e6 * u - z, z=z, algebraic=z - x)
    ocp = pulled(model, x0=[1e6], running_cost=(x / 1e6) ** 2 + u**2)
    decision = MPC(ocp=ocp, solver=MultipleShooting(10), dt=0.1).step([1e6], 0.0)
    assert decision.source.name == "OPTIMAL"


def test_a_pulse_by_the_clock_that_a_variable_times_is_seen() -> None:
    model = Model(
        name="pulse", x=x, u=u, t=t, f=u + ca.if_else(t < z, 1, 0), z=z, algebraic=z - 0.3
    )
    found = solve(pulled(model), Collocation(10))
    assert evaluate(found).cost < np.inf


def test_all_constants_on_bounds_leave_nothing_to_estimate() -> None:
    decaying = Model(name="decaying", x=x, u=ca.SX(0, 1), f=-k * x)
    ocp = OCP(
        name="decay",
        model=decaying,
        x0=[1.0],
        horizon=1.0,
        unknowns=(Unknown("k", k, 1.0, 0.5, 1.0),),
        data=(Measurement("seen", x, [0.5, 1.0], [0.5, 0.2], 0.1),),
    )
    assert estimate(solve(ocp, Collocation(10))).held == ("k",)


def test_a_solution_with_a_constant_starts_a_problem_without_it() -> None:
    known = solve(pulled(unknowns=(Unknown("k", k, 1.0),), terminal_cost=(k - x) ** 2 + k**2),
                  MultipleShooting(10))  # fmt: skip
    found = solve(pulled(peaks=(Peak("top", x),)), MultipleShooting(10), guess=known)
    assert found.status.is_success


def test_an_unknown_constant_has_no_name_of_a_control_that_moves() -> None:
    twin = ca.SX.sym("u")
    with pytest.raises(ProblemError, match="'u'"):
        pulled(
            rates=(Rate(u, -1, 1),),
            unknowns=(Unknown("k", twin, 1.0),),
            terminal_cost=(twin - x) ** 2,
        )


def test_a_small_control_jumps_too() -> None:
    """What is a jump goes by the size of the control, not by 1."""
    m = Model(name="small", x=x, u=u, f=u, x_nominal=[1e-10], u_nominal=[1e-10])
    ocp = pulled(m, running_cost=1e20 * (u**2 + (x - 1e-10) ** 2), rates=(Rate(u, -1, 1),))
    found = solve(ocp, MultipleShooting(10))
    held = found.with_(u=np.repeat([[0.0], [1e-10]], 5, axis=0), control_kind="held", normal=None)
    assert evaluate(held).violation == np.inf


def test_instants_stay_nodes_where_a_signal_has_too_many_knots() -> None:
    signal = Signal("noise", r, np.sin(np.arange(101.0)), hold="held")
    ocp = pulled(
        parameters=(signal,),
        running_cost=u**2 + 1e-3 * r * x,
        constraints=(Constraint("by", x, 1, 1, at=0.3333),),
    )
    found = solve(ocp, MultipleShooting(20))
    assert np.abs(found.fractions - 0.3333).min() < 1e-9


def test_instants_of_two_constraints_are_counted_once() -> None:
    at = (0.2, 0.4, 0.6)
    both = (Constraint("low", x, lower=-1, at=at), Constraint("high", x, upper=5, at=at))
    assert solve(pulled(constraints=both), MultipleShooting(5)).status.is_success


def test_blocks_of_phases_hold_no_slacks() -> None:
    """Beside a phase that costs nothing, one phase is what it is alone."""
    soft = Constraint("slow", x, upper=0.1, soft=Soft(linear=1.0))
    one = pulled(name="one", constraints=(soft,))
    idle = pulled(name="idle", running_cost=0.0)
    alone = solve(one, MultipleShooting(8, blocks=(4, 4)))
    beside = solve(Phases("two", (one, idle)), MultipleShooting(8, blocks=(4, 4)))
    assert beside.cost == pytest.approx(alone.cost, abs=1e-6)


def test_blocks_hold_the_rate_of_a_control_and_no_slack() -> None:
    """In the least violating plan too, whose slack stands between."""
    rated = pulled(
        rates=(Rate(u, -1, 1),),
        last_input=[0.0],
        constraints=(Constraint("far", x, lower=0.4, upper=9),),
    )
    program = MultipleShooting(8, blocks=(4, 4)).least_violating(rated)
    assert program is not None
    plan = program.run()
    rates = np.diff(plan.control(plan.t)[:, 0]) / np.diff(plan.t)
    assert np.ptp(rates[:4]) < 1e-6
    assert np.ptp(rates[4:]) < 1e-6


def test_phases_take_the_last_input_of_a_run() -> None:
    rated = pulled(name="rated", rates=(Rate(u, -1, 1),), last_input=[0.0])
    chain = Phases("two", (rated, pulled(name="free")), links=(Link(),))
    program = MultipleShooting(10).build(chain)
    for last in (0.0, 0.5):
        found = program.run(parameters={"last_input": [last]})
        assert found.phases[0].control(0.0)[0] == pytest.approx(last, abs=1e-6)
