"""Constrained linear control: bounds, soft constraints, backends, messages."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
import qpsolvers

from benchmarks.figures.mpc_runs import finite, peak, receding
from models import (
    lq_regulator,
    mass_spring_damper,
    sinusoid,
    stable_plant,
    thesis_regulator,
    thesis_tracking,
    tracking_ocp,
    unstable_plant,
)
from ocp import (
    OCP,
    Box,
    Constraint,
    Model,
    ProblemError,
    Solution,
    Status,
    UnsupportedProblem,
    evaluate,
    solve,
)
from solvers import LinearMPC, MultipleShooting
from solvers.linear.qp.qp_backends import NamedBackend, known_backends, qp_backend
from solvers.linear.qp.quadratic_program import residuals
from tests import tolerances

BOUND, STEPS, DT = 2.0, 160, 0.05
BACKENDS = ("osqp", "piqp", "clarabel", "daqp", "proxqp", "quadprog", "highs", "scs")
FORMS = ("sparse", "condensed")


def plant_step(dt: float = DT):
    plant = mass_spring_damper().sampled(dt)
    return lambda x, u: plant.A @ x + plant.B @ u


def needs(backend: str) -> None:
    if backend not in qpsolvers.available_solvers:
        pytest.skip(f"{backend} is not installed")


# -- the thesis' example ----------------------------------------------------------------


@pytest.mark.slow
def test_constraints_hold_at_every_step_and_short_horizons_are_myopic():
    peaks = {0: peak(finite())}
    for steps in (5, 10, 20, 40):
        run = receding(steps, form="sparse")
        peaks[steps] = peak(run)
        assert np.abs(run.x[:, 0]).max() <= BOUND + 1e-6
        assert np.abs(run.x[:, 0]).max() > BOUND - 1e-6, "the reference exceeds the bound"
        assert np.abs(run.inputs).max() <= 40.0 + 1e-6
    assert evaluate(solve(thesis_tracking(STEPS), LinearMPC())).violation <= 1e-6
    assert peaks[5] >= 1.15 * peaks[0]
    assert (peaks[5], peaks[0]) == pytest.approx((14.2, 11.7), abs=0.05)


def test_a_reference_without_velocity_turns_the_order_round():
    peaks = peak(receding(5, moving=False, form="sparse")), peak(finite(moving=False))
    assert peaks == pytest.approx((7.1, 10.0), abs=0.1)


@pytest.mark.many
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("steps", "dt"), [(10, 0.01), (20, 0.01), (25, 0.01), (40, 0.02)])
def test_a_finely_sampled_bound_does_not_make_the_active_rows_cycle(form, steps, dt):
    """While the mass arrives at its bound, exchanging all wrong rows at once never ends."""
    program = LinearMPC(form=form).prepare(thesis_tracking(steps, dt=dt))
    reference = sinusoid(dt * np.arange(round(1.6 / dt) + steps + 1))
    step, x, touched = plant_step(dt), np.zeros(2), 0
    for k in range(round(1.5 / dt)):
        ahead = {"reference": reference[k : k + steps + 1]}
        plan = program.run(x0=x, t0=k * dt, parameters=ahead)
        assert plan.status is Status.SOLVED, (k, plan.message)
        assert plan.residual <= 1e-9
        assert plan.iterations <= 500, "OSQP's first, loose guess is enough"
        touched += bool(plan.history["multipliers"].any())
        x = step(x, plan.u[0])
    assert touched > 0.3 / dt


@pytest.mark.parametrize("form", FORMS)
def test_it_agrees_with_an_interior_point_method(form):
    ocp = thesis_tracking(20)
    for x0 in ([0.0, 0.0], [1.9, 1.0], [-1.0, 4.0]):
        mine = LinearMPC(form=form).prepare(ocp).run(x0=x0)
        other = MultipleShooting().prepare(ocp).run(x0=x0)
        assert mine.status is Status.SOLVED
        assert max(mine.history[k][0] for k in ("primal", "dual", "gap")) < 1e-10
        np.testing.assert_allclose(mine.u, other.u, atol=1e-6)
        scale = np.abs(mine.costate).max()
        np.testing.assert_allclose(mine.costate, other.costate, atol=1e-6 * scale)
        assert evaluate(mine).violation <= 1e-9


@pytest.mark.parametrize("form", FORMS)
def test_costate_is_the_slope_of_the_cost_where_constraints_are_active(form):
    program, step = LinearMPC(form=form).prepare(thesis_tracking(20)), tolerances.COST_STEP
    x0 = np.array([1.5, 2.0])
    solution = program.run(x0=x0)
    assert np.isclose(solution.x[:, 0], BOUND).any()
    for i, direction in enumerate(np.eye(2)):
        ends = [program.run(x0=x0 + s * step * direction).cost for s in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * step)
        assert solution.costate[0, i] == pytest.approx(slope, abs=1e-4)  # of the order of 1000


@pytest.mark.parametrize("form", FORMS)
def test_mixed_terminal_and_path_constraints_of_a_changing_plant(form):
    x, u, t = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("t")
    ocp = OCP(
        name="mixed",
        model=Model(
            name="m",
            x=x,
            u=u,
            f=ca.vertcat(x[0] + 0.1 * x[1], (1 + 0.1 * ca.cos(t)) * x[1] + u[0] / 10 + u[1] / 20),
            t=t,
            dt=0.1,
        ),
        x0=[1.0, 0.0],
        horizon=25,
        running_cost=ca.sumsqr(x) + 0.1 * ca.sumsqr(u) + u[0] * x[1] * 0.1,
        control_bounds=Box([-2.0, -np.inf], [np.inf, 1.5]),
        constraints=(
            Constraint("mixed", u[0] + u[1] + x[1] + 0.1 * t, lower=-1.8),
            Constraint("speed", x[1], -0.6, 0.6),
            Constraint("end", x, [0.0, -0.01], [0.0, 0.01], at="terminal"),
        ),
    )  # fmt: skip
    program = LinearMPC(form=form).prepare(ocp)
    for t0 in (0.0, 2.0):
        mine, other = program.run(t0=t0), MultipleShooting().prepare(ocp).run(t0=t0)
        assert mine.status is other.status is Status.SOLVED
        np.testing.assert_allclose(mine.u, other.u, atol=1e-6)
        np.testing.assert_allclose(mine.costate, other.costate, atol=1e-5)
        mixed = mine.u.sum(axis=1) + mine.x[:-1, 1] + 0.1 * mine.t[:-1]
        assert mixed.min() >= -1.8 - 1e-9
        assert np.abs(mine.x[1:, 1]).max() <= 0.6 + 1e-9
        assert np.abs(mine.x[-1]) == pytest.approx([0.0, 0.0], abs=0.01 + 1e-9)


# -- what cannot be met --------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
def test_infeasible_start_names_constraint_and_step(form):
    program = LinearMPC(form=form).prepare(thesis_tracking(5))
    failed = program.run(x0=[1.9, 40.0])
    assert failed.status is Status.INFEASIBLE
    assert "'bound of position' at step 5" in failed.message
    assert np.isfinite(failed.u).all()
    assert program.run(x0=[0.0, 0.0]).status is Status.SOLVED, "and the program is as good as new"


def test_measured_state_outside_its_bound_is_no_reason_to_fail():
    solution = LinearMPC().prepare(thesis_tracking(10)).run(x0=[2.0 + 1e-9, 0.0])
    assert solution.status is Status.SOLVED
    assert np.abs(solution.x[1:, 0]).max() <= 2.0 + 1e-9


@pytest.mark.parametrize("form", FORMS)
def test_a_start_outside_its_bounds_is_named_and_the_rest_is_optimal(form):
    ocp, x0 = thesis_tracking(10), [2.05, -1.0]
    outside = LinearMPC(form=form).prepare(ocp).run(x0=x0)
    direct = MultipleShooting(10).prepare(ocp).run(x0=x0)
    assert outside.status is direct.status is Status.INFEASIBLE
    assert outside.message == direct.message
    assert "by the given start itself" in outside.message
    np.testing.assert_allclose(outside.u, direct.u, atol=1e-6)
    soft = LinearMPC(form=form, soft=1e5).prepare(ocp).run(x0=x0)
    assert soft.status is Status.SOLVED, "what may give way is no fault"


@pytest.mark.parametrize("form", FORMS)
def test_soft_constraints_are_exact_and_give_way_only_if_they_must(form):
    ocp = thesis_tracking(10)
    hard, soft = LinearMPC(form=form).prepare(ocp), LinearMPC(form=form, soft=1e5).build(ocp)
    for x0 in ([0.0, 0.0], [1.5, 2.0]):
        a, b = hard.run(x0=x0), soft.run(x0=x0)
        np.testing.assert_allclose(a.u, b.u, atol=1e-6)
        np.testing.assert_allclose(a.costate, b.costate, rtol=1e-5, atol=1e-4)
        assert b.message == ""
    late = soft.run(x0=[1.9, 10.0])
    assert late.status is Status.SOLVED
    assert "soft constraint 'bound of position'" in late.message
    assert np.abs(late.u).max() <= 40.0 + 1e-9, "bounds of controls stay hard"


# -- backends ------------------------------------------------------------------------------


def random_problem(seed: int) -> tuple[OCP, np.ndarray]:
    """A feasible tracking problem: the bounds contain a trajectory of bounded controls."""
    rng = np.random.default_rng(seed)
    plant = (stable_plant(), unstable_plant(), mass_spring_damper().sampled(0.1))[seed % 3]
    n, steps = len(plant.A), int(rng.integers(5, 20))
    x, x0 = [rng.normal(size=n)], rng.normal(size=n)
    x[0] = x0
    for _ in range(steps):
        x.append(plant.A @ x[-1] + plant.B @ rng.uniform(-1, 1, size=1))
    width = np.abs(x).max(axis=0) + 0.1
    ocp = tracking_ocp(
        plant, rng.normal(size=(steps + 1, n)), Q=rng.uniform(0.5, 2.0, n), R=0.1, P=1.0,
        x0=x0, horizon=steps, control_bounds=Box(-1.0, 1.0), state_bounds=Box(-width, width),
    )  # fmt: skip
    return ocp, x0


@cache
def solved_by_osqp(seed: int) -> tuple[OCP, Solution]:
    """Return a random problem and the answer that the backends have to agree with."""
    ocp, _ = random_problem(seed)
    return ocp, solve(ocp, LinearMPC(form="condensed"))


@pytest.mark.many
@pytest.mark.parametrize("backend", BACKENDS)
def test_backends_agree_on_random_feasible_problems(backend):
    needs(backend)
    tolerance = 1e-8
    for seed in range(20):
        ocp, reference = solved_by_osqp(seed)
        mine = solve(ocp, LinearMPC(backend=backend, tolerance=tolerance, form=FORMS[seed % 2]))
        assert mine.status is reference.status is Status.SOLVED, (seed, mine.message)
        assert mine.residual <= tolerance
        assert mine.cost == pytest.approx(reference.cost, rel=10 * tolerance)
        # The cost rises by at least R du^2 from its minimum, and R = 0.1.
        within = np.sqrt(2 * tolerance * (1 + abs(reference.cost)) / 0.1)
        np.testing.assert_allclose(mine.u, reference.u, atol=within)


def test_unknown_and_missing_backends_are_told_apart():
    with pytest.raises(ProblemError, match="not one of"):
        LinearMPC(backend="cplex3000").prepare(thesis_tracking(5))
    missing = sorted(set(known_backends()) - set(qpsolvers.available_solvers))
    with pytest.raises(ProblemError, match=r"not installed: pip install"):
        qp_backend(missing[0], 1e-6)


def test_an_error_inside_a_backend_is_its_own(monkeypatch):
    def broken(*args, **kwargs):
        raise KeyError("a bug inside")

    monkeypatch.setitem(qpsolvers.solvers.solve_function, "osqp", broken)
    program = LinearMPC().prepare(thesis_tracking(5))
    object.__setattr__(program, "backend", NamedBackend("osqp", 1e-6))
    solution = program.run()
    assert solution.status is Status.FAILED
    assert "KeyError inside the backend" in solution.message


def test_residuals_are_those_of_the_program():
    ocp = thesis_tracking(10)
    program = LinearMPC().prepare(ocp)
    solution = program.run(x0=[1.5, 2.0])
    qp = program.quadratic_program(solution.data)
    z = program.form.point(solution.x, solution.u, program.lq.on(solution.data))
    assert residuals(qp, z, np.zeros(len(qp.l))).primal < 1e-12
    assert residuals(qp, z, np.zeros(len(qp.l))).dual > 1e-2
    wrong_sign = np.zeros(len(qp.l))
    free = np.flatnonzero(np.isinf(qp.u))
    assert not free.size
    assert residuals(qp._replace(u=np.full(len(qp.u), np.inf)), z, wrong_sign + 1).dual > 1e-3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"form": "dense"}, "form"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": "tight"}, "tolerance = 'tight', it must be positive, below 1"),
        ({"soft": -1.0}, "soft = -1.0, it must be positive"),
        ({"soft": "dear"}, "soft = 'dear'"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ProblemError, match=message):
        LinearMPC(**options)


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ({"Q": [[1, 2, 0], [0, 1, 0], [0, 0, 1]], "R": 1}, "Q is not symmetric"),
        ({"Q": -1.0, "R": 1}, "Q is not positive semi-definite: it has the eigenvalue -1"),
        ({"Q": 1.0, "R": 0}, "R is not positive definite"),
        ({"Q": 1.0, "R": 1, "P": [1.0, 2.0]}, "P has 2 entries, 3 are needed"),
        ({"Q": np.eye(2), "R": 1}, r"Q has shape \(2, 2\)"),
        ({"Q": np.nan, "R": 1}, "finite"),
    ],
)
def test_bad_weights_are_named(weights, message):
    with pytest.raises(ProblemError, match=message):
        lq_regulator(stable_plant(), x0=np.zeros(3), horizon=5, **weights)


def test_reference_that_is_too_short_is_refused():
    program = LinearMPC().prepare(thesis_tracking(10))
    with pytest.raises(ProblemError, match="'reference' has 8 samples"):
        program.run(parameters={"reference": np.zeros((8, 2))})


def test_nothing_is_printed(capfd):
    for form in FORMS:
        solve(thesis_regulator(stable_plant(), 10), LinearMPC(form=form))
    captured = capfd.readouterr()
    assert captured.out == captured.err == ""


def test_a_solution_starts_it():
    ocp = thesis_tracking(20)
    other = MultipleShooting().prepare(ocp).run(x0=[1.5, 2.0])
    for form in FORMS:
        mine = LinearMPC(form=form).prepare(ocp).run(x0=[1.5, 2.0], guess=other)
        assert mine.status is Status.SOLVED


def test_a_backend_that_needs_curvature_is_refused_at_build_without_it() -> None:
    pytest.importorskip("quadprog")
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    seen = OCP(
        name="position only",
        model=Model(name="mass", x=x, u=u, f=ca.vertcat(x[0] + 0.1 * x[1], x[1] + u), dt=0.1),
        x0=[1.0, 0.0],
        horizon=10,
        running_cost=x[0] ** 2 + u**2,
    )
    with pytest.raises(UnsupportedProblem, match="positive definite"):
        LinearMPC("quadprog").build(seen)
    condensed = solve(seen, LinearMPC("quadprog", form="condensed"))
    assert condensed.cost == pytest.approx(solve(seen, LinearMPC()).cost)
