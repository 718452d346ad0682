"""Algebraic variables of index 1: solved for, in every method, and judged as they are written."""

import pickle
import warnings
from functools import cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ocp import (
    MPC,
    OCP,
    Constraint,
    Model,
    Parameter,
    Plant,
    ProblemError,
    Solution,
    Status,
    Unknown,
    closed_loop,
    evaluate,
    solve,
)
from ocp.internal import normal_form
from ocp.method.rewriting import RewrittenProgram
from solvers import (
    Collocation,
    IndirectShooting,
    MultipleShooting,
    Schuetz,
    StagewiseNewton,
    certify,
    diagnose,
    polish,
)
from tests.ocp.differences import jacobian

x, u, z, t = (ca.SX.sym(name) for name in "xuzt")


EXPONENTIAL = ca.log(z) - x


def tank(g: ca.SX = EXPONENTIAL, z_guess: ca.SX | float | None = 1.0, **changes) -> OCP:
    """dx/dt = u - z, z = exp(x) by an equation that only a root finder solves."""
    model = Model(name="tank", x=x, u=u, t=t, z=z, f=u - z, algebraic=g, z_guess=z_guess)
    given = {
        "name": "tank",
        "model": model,
        "x0": [0.5],
        "horizon": 1.0,
        "running_cost": z**2 + u**2,
        "terminal_cost": 2 * x**2,
    }
    return OCP(**(given | changes))


def by_hand(**changes) -> OCP:
    """The same with z written out."""
    given = {
        "name": "by hand",
        "model": Model(name="tank", x=x, u=u, f=u - ca.exp(x)),
        "x0": [0.5],
        "horizon": 1.0,
        "running_cost": ca.exp(2 * x) + u**2,
        "terminal_cost": 2 * x**2,
    }
    return OCP(**(given | changes))


METHODS = (
    MultipleShooting(30),
    MultipleShooting(30, backend="fatrop"),
    StagewiseNewton(30),
    Collocation(10),
    IndirectShooting(),
    Schuetz(intervals=30),
)


@pytest.mark.many
@pytest.mark.parametrize("solver", METHODS, ids=lambda s: type(s).__name__)
def test_every_method_finds_what_it_finds_with_the_variable_written_out(solver) -> None:
    found, plain = solve(tank(), solver), solve(by_hand(), solver)
    assert found.status is plain.status
    # Collocation makes z a polynomial of its own: its quadrature differs by the error of both.
    within = 1e-8 if isinstance(solver, Collocation) else 1e-12
    assert abs(found.cost - plain.cost) < within * (1 + plain.cost)
    np.testing.assert_allclose(found.costate, plain.costate, atol=1e-6)
    np.testing.assert_allclose(found.z[:, 0], np.exp(found.x[:, 0]), rtol=1e-12)
    assert found.u.shape == plain.u.shape
    verdict = evaluate(found)
    assert verdict.violation < 1e-12
    assert abs(verdict.cost - evaluate(plain).cost) < 1e-8


def test_collocation_takes_the_variable_as_a_control() -> None:
    """No root is looked for on the way: the equations hold at its points."""
    program = Collocation(10).build(tank())
    assert isinstance(program, RewrittenProgram)
    assert isinstance(program.program, RewrittenProgram)
    inner = program.program.rewriting.problem
    assert inner.model.u_names == ("u", "z")
    assert [c.name for c in inner.constraints] == ["algebraic equations"]


def test_what_is_linear_is_solved_as_an_expression() -> None:
    a, b = ca.SX.sym("z", 2), ca.SX.sym("x", 2)
    g = ca.vertcat((2 + b[0] ** 2) * a[0] + a[1] - u, a[0] - 3 * a[1] + b[1])
    model = Model(name="linear", x=b, u=u, z=a, f=a, algebraic=g)
    ocp = OCP(name="linear", model=model, x0=[1, 0], horizon=1.0, running_cost=ca.sumsqr(b) + u**2)
    assert "root" not in str(ocp.explicit.model.f)
    values = np.array(ocp.functions.algebraic([1.0, 0.3], 0.7, 0.0, [])).ravel()
    np.testing.assert_allclose(values, np.linalg.solve([[3, 1], [1, -3]], [0.7, -0.3]), rtol=1e-14)


def test_equations_are_solved_block_by_block() -> None:
    """z2 of z1 of z0: the middle one alone needs a root finder."""
    a = ca.SX.sym("z", 3)
    g = ca.vertcat(a[2] - a[1] * x, 2 * a[0] - x, ca.exp(a[1]) + a[1] - 1 - a[0])
    model = Model(name="chain", x=x, u=u, z=a, f=-a[2] + u, algebraic=g, z_guess=[0, 0, 0])
    ocp = OCP(name="chain", model=model, x0=[0.8], horizon=1.0, running_cost=x**2 + u**2)
    z0, z1, z2 = np.array(ocp.functions.algebraic(0.8, 0.0, 0.0, [])).ravel()
    assert z0 == 0.4
    assert abs(np.exp(z1) + z1 - 1.4) < 1e-14
    assert z2 == pytest.approx(0.8 * z1, rel=1e-15)
    assert str(ocp.explicit.model.f).count("root") == 1


@cache
def coupled() -> tuple[ca.Function, ca.Function, ca.Function]:
    """A root, its slope and its curvature."""
    value = tank(z**3 + z * (1 + u**2) - ca.sin(x) - u, 0.0).algebraic_solution.values
    both = ca.vertcat(x, u)
    outputs = value, ca.jacobian(value, both), ca.hessian(value, both)[0]
    root, slope, curvature = (ca.Function("of", [both], [ca.densify(e)]) for e in outputs)
    return root, slope, curvature


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_derivatives_are_exact(at_x: float, at_u: float) -> None:
    root, slope, curvature = (lambda v, f=f: np.array(f(v)) for f in coupled())
    point = np.array([at_x, at_u])
    np.testing.assert_allclose(slope(point), jacobian(root, point), atol=1e-8)
    np.testing.assert_allclose(curvature(point), jacobian(slope, point), atol=1e-7)


@pytest.mark.parametrize(
    ("guess", "root"), [(4.0, (5 + np.sqrt(21)) / 2), (0.1, (5 - np.sqrt(21)) / 2)]
)
def test_the_guess_says_which_root_is_meant(guess: float, root: float) -> None:
    ocp = tank(z / (1 + z**2) - 0.2 * x / x, guess, x0=[1.0])
    assert float(ocp.functions.algebraic(1.0, 0.0, 0.0, [])) == pytest.approx(root, rel=1e-12)


def test_a_guess_may_be_an_expression() -> None:
    ocp = tank(z**2 - ca.exp(2 * x), ca.exp(x) + 0.1)
    found = solve(ocp, MultipleShooting(20))
    np.testing.assert_allclose(found.z[:, 0], np.exp(found.x[:, 0]), rtol=1e-12)


def test_a_root_far_from_the_guess_is_followed() -> None:
    """Newton's full steps diverge for atan from beyond 1.39."""
    ocp = tank(ca.atan(z) - x, 3.0)
    assert float(ocp.functions.algebraic(0.5, 0.0, 0.0, [])) == pytest.approx(
        np.tan(0.5), rel=1e-12
    )


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_units_of_equations_and_variables_do_not_matter(size: float) -> None:
    ocp = tank(size * (ca.log(z / size) - x), size, running_cost=(z / size) ** 2 + u**2)
    value = float(ocp.functions.algebraic(0.5, 0.0, 0.0, []))
    assert value == pytest.approx(size * np.exp(0.5), rel=1e-12)


def test_without_a_root_nothing_passes_for_one() -> None:
    """Beyond x = 1 there is none: the start is there."""
    ocp = tank(z**2 - 1 + x, 1.0, x0=[0.5])
    assert np.isnan(float(ocp.functions.algebraic(1.5, 0.0, 0.0, [])))
    found = MultipleShooting(20).build(ocp).run(x0=[1.5])
    assert not found.status.is_success


def test_bounds_and_costs_are_of_the_variable() -> None:
    """Its bound acts, and is named as the user did."""
    slow = Constraint("flow", z, upper=1.2)
    found = solve(tank(constraints=(slow,), x0=[0.0], running_cost=(u - 4) ** 2), Collocation(20))
    assert found.status is Status.SOLVED
    assert found.algebraic(np.linspace(0, 1, 301)).max() == pytest.approx(1.2, abs=1e-5)
    worse = found.with_(u=found.u + 1.0)
    assert "'flow'" in evaluate(worse).worst


def test_unknown_constants_integrals_and_parameters_go_together_with_it() -> None:
    k, load = ca.SX.sym("k"), ca.SX.sym("load")
    ocp = tank(
        ca.log(z) - k * x - load,
        1.0,
        unknowns=(Unknown("k", k, 1.0, 0.5, 2.0),),
        parameters=(Parameter("load", load, 0.1),),
        constraints=(Constraint("throughput", z, 1.3, 1.3, at="integral"),),
    )
    for solver in (MultipleShooting(40), Collocation(12)):
        found = solve(ocp, solver).or_raise()
        verdict = evaluate(found)
        assert verdict.violation < 1e-6, verdict.worst
        np.testing.assert_allclose(
            found.z[:, 0], np.exp(found.unknowns["k"] * found.x[:, 0] + 0.1), rtol=1e-10
        )


def test_an_implicit_equation_of_motion() -> None:
    """F(dx/dt, x, u) = 0 with the rate as algebraic variable."""
    model = Model(name="implicit", x=x, u=u, z=z, f=z, algebraic=z + 0.1 * z**3 + x - u, z_guess=0)
    ocp = OCP(name="implicit", model=model, x0=[1.0], horizon=1.0, running_cost=x**2 + u**2)
    true = [evaluate(solve(ocp, s).or_raise()).cost for s in (Collocation(8), MultipleShooting(80))]
    assert abs(true[0] - true[1]) < 1e-4  # of a held control


def test_in_discrete_time() -> None:
    model = Model(name="steps", x=x, u=u, z=z, f=0.5 * x + z, algebraic=ca.exp(z) - 1 - u,
                  z_guess=0, dt=0.1)  # fmt: skip
    plain = Model(name="steps", x=x, u=u, f=0.5 * x + ca.log(1 + u), dt=0.1)
    costs = [
        solve(
            OCP(name="steps", model=m, x0=[1.0], horizon=5, running_cost=x**2 + u**2),
            MultipleShooting(5),
        ).or_raise().cost
        for m in (model, plain)
    ]  # fmt: skip
    assert abs(costs[0] - costs[1]) < 1e-12


@pytest.mark.slow
def test_a_polished_answer_is_a_minimum() -> None:
    polished = polish(solve(tank(), Collocation(12)))
    assert polished.status is Status.SOLVED
    assert polished.z.shape == (len(polished.t), 1)
    assert abs(polished.cost - polish(solve(by_hand(), Collocation(12))).cost) < 1e-10


@pytest.mark.slow
def test_it_is_certified() -> None:
    certificate = certify(solve(tank(), Collocation(12)))
    assert certificate.holds, certificate
    assert "as written" in str(certificate)


@pytest.mark.slow
def test_a_sound_problem_is_diagnosed_as_one() -> None:
    assert not diagnose(tank()).findings


@pytest.mark.slow
def test_it_is_described_saved_and_copied(tmp_path) -> None:
    ocp = tank()
    assert "0 = (log(z)-x)" in ocp.describe()
    assert "1 algebraic variable" in ocp.describe()
    found = solve(ocp, Collocation(8))
    again = Solution.load(found.save(tmp_path / "tank.npz"), ocp)
    np.testing.assert_array_equal(again.z, found.z)
    copy = pickle.loads(pickle.dumps(ocp))
    assert solve(copy, MultipleShooting(10)).cost == solve(ocp, MultipleShooting(10)).cost
    assert set(ocp.model.z_names) <= set(found.plot().names)


@pytest.mark.slow
def test_a_loop_runs_in_machine_code() -> None:
    ocp = tank()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mpc = MPC(ocp=ocp, solver=MultipleShooting(10), dt=0.1)
        rollout = closed_loop(mpc, Plant(ocp=ocp), [0.5], 0.3, dt=0.1)
    assert all(source.name == "OPTIMAL" for source in rollout.sources)


a2 = ca.SX.sym("a", 2)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"algebraic": ca.vertcat(z, z)}, "algebraic has 2 rows, but there are 1"),
        ({"algebraic": z**3 - x, "z_guess": None}, "not linear in z: Newton"),
        ({"z_guess": [1.0, 2.0]}, "z_guess has 2 rows"),
        ({"z_guess": np.nan}, "z_guess = nan is not finite"),
        ({"z_guess": "one"}, "z_guess"),
        ({"z": x}, "declared twice"),
        ({"z": z + 1}, "z_guess|must be a dense column of symbols"),
        ({"algebraic": z - a2[0]}, "algebraic contains a_0"),
        ({"z_guess": a2[0]}, "z_guess contains a_0"),
        ({"algebraic": x - 1}, "index is higher than 1"),
        ({"algebraic": z**2 + 1 + x**2}, "no root"),
        ({"algebraic": z * 0.0 * u + x}, "singular|index"),
        ({"z_units": ("m", "s")}, "z_units has 2 entries"),
    ],
)
def test_what_is_wrong_is_named(changes: dict, said: str) -> None:
    given = {"name": "tank", "x": x, "u": u, "z": z, "f": u - z, "z_guess": 1.0,
             "algebraic": ca.log(z) - x}  # fmt: skip
    with pytest.raises(ProblemError, match=said):
        OCP(name="tank", model=Model(**(given | changes)), x0=[0.5], horizon=1.0)


def test_a_higher_index_is_named_with_the_equation() -> None:
    """The pendulum in Cartesian coordinates: its rod contains no force."""
    at, force = ca.SX.sym("at", 4), ca.SX.sym("force")
    f = ca.vertcat(at[2], at[3], -force * at[0], -force * at[1] - 9.81 + u)
    rod = ca.sumsqr(at[:2]) - 1
    model = Model(name="pendulum", x=at, u=u, z=force, f=f, algebraic=rod)
    with pytest.raises(ProblemError, match=r"algebraic equation 0 .*index is higher"):
        OCP(name="pendulum", model=model, x0=[1, 0, 0, 0], horizon=1.0)


def test_two_equations_that_say_the_same_are_named() -> None:
    g = ca.vertcat(a2[0] + a2[1] - x, 2 * a2[0] + 2 * a2[1] - u)
    model = Model(name="twice", x=x, u=u, z=a2, f=a2[0], algebraic=g)
    with pytest.raises(ProblemError, match=r"algebraic equation \d .*singular"):
        OCP(name="twice", model=model, x0=[1.0], horizon=1.0)


def test_at_the_ends_there_is_no_control() -> None:
    with pytest.raises(ProblemError, match="terminal_cost contains the algebraic variable z"):
        tank(ca.log(z) - x - u, 1.0, terminal_cost=z**2)
    at_end = tank(terminal_cost=z**2)  # of the state alone
    assert solve(at_end, MultipleShooting(10)).status.is_success


def test_the_normal_form_has_none() -> None:
    form = normal_form(tank())
    assert form is not None
    assert form.problem.model.nz == 0
    assert form.original.model.nz == 1
