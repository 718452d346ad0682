"""A stage that brings its derivatives along: those of the stage written out, in less code."""

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from models.textbook import van_der_pol
from ocp import OCP, RK4, Euler, Integrator, Midpoint
from ocp.codegen.compile import c_code
from ocp.integration.differentiable_step import differentiable_step
from ocp.integration.one_step import Stage
from tests.linear_dp.problems import unstable_mass
from tests.ocp.differences import jacobian
from tests.solvers.problems import changed, quartic, timed_transfer, tracker


def arm() -> OCP:
    return arm_scenario("arm-001").ocp()


def timed_tracker() -> OCP:
    """Signals, an explicit time in rate and cost, and a free final time."""
    return changed(tracker(), horizon=timed_transfer().horizon)


PROBLEMS = [tracker, timed_transfer, timed_tracker, van_der_pol, quartic, arm, unstable_mass]


def along(ocp: OCP) -> list[str]:
    return ["x", "u0", "t", "h"] if ocp.has_free_time else ["x", "u0"]


def written_out(ocp: OCP, integrator: Integrator) -> ca.Function:
    step = Stage.of(ocp, integrator, held=True).step
    inputs, names = step.sx_in(), (step.name_in(), step.name_out())
    flags = {"is_diff_in": [name in along(ocp) for name in step.name_in()]}
    return ca.Function("step", inputs, step.call(inputs), *names, flags)


def numbers(function: ca.Function, ocp: OCP) -> list[ca.DM]:
    """Return inputs near the start; what CasADi hands over of the values has no entries."""
    rng = np.random.default_rng(0)
    patterns = [function.sparsity_in(i) for i in range(function.n_in())]
    values = [ca.DM(p, rng.uniform(0.1, 0.9, size=p.nnz())) for p in patterns]
    values[0] += ocp.start() - 0.5
    return values


@pytest.mark.many
@pytest.mark.parametrize("integrator", [Euler(), Midpoint(2), RK4(), RK4(3)], ids=repr)
@pytest.mark.parametrize("make", PROBLEMS)
def test_what_casadi_asks_for_is_that_of_the_stage(make, integrator):
    ocp = make()
    one, other = differentiable_step(ocp, integrator), written_out(ocp, integrator)
    pairs = [(one, other), (one.jacobian(), other.jacobian()), (one.reverse(1), other.reverse(1))]
    pairs += [(one.reverse(1).jacobian(), other.reverse(1).jacobian())]
    for ours, theirs in pairs:
        assert ours.name_in() == theirs.name_in()
        assert ours.name_out() == theirs.name_out()
        given = numbers(ours, ocp)
        for name, a, b in zip(ours.name_out(), ours.call(given), theirs.call(given), strict=True):
            assert a.sparsity() == b.sparsity(), name
            if b.nnz():
                largest = max(1.0, float(ca.norm_inf(ca.vec(b))))
                np.testing.assert_allclose(np.array(a), np.array(b), atol=1e-12 * largest)


def test_derivatives_along_everything_unknown_are_those_of_finite_differences():
    """Along t and h as well: the final time is free, and everything depends on t."""
    ocp = timed_tracker()
    step = differentiable_step(ocp, RK4(2))
    given, costate, price = numbers(step, ocp), ca.DM([0.7, -1.3]), ca.DM(0.4)
    w = np.concatenate([np.array(part).ravel() for part in given[:4]])

    def at(w: np.ndarray) -> list[ca.DM]:
        return [ca.DM(w[:2]), *map(ca.DM, w[2:]), *given[4:]]

    def ends(w: np.ndarray) -> np.ndarray:
        return np.array(ca.vertcat(*step.call(at(w)))).ravel()

    adjoint = step.reverse(1)
    empty = [ca.DM(adjoint.sparsity_in(i)) for i in (6, 7)]

    def pulled(w: np.ndarray) -> np.ndarray:
        return np.array(ca.vertcat(*adjoint.call([*at(w), *empty, costate, price])[:4])).ravel()

    seeds = [*at(w), *empty]
    first = step.jacobian().call(seeds)
    rows = [ca.horzcat(*first[:4]), ca.horzcat(*first[6:10])]
    np.testing.assert_allclose(np.array(ca.vertcat(*rows)), jacobian(ends, w), atol=1e-8)

    bent = adjoint.jacobian()
    values = [ca.DM(bent.sparsity_in(i)) for i in range(10, bent.n_in())]
    second = bent.call([*seeds, costate, price, *values])
    hessian = [ca.horzcat(*second[10 * i : 10 * i + 4]) for i in range(4)]
    np.testing.assert_allclose(np.array(ca.vertcat(*hessian)), jacobian(pulled, w), atol=1e-8)


def test_a_row_of_stages_is_differentiated_by_the_same_functions():
    ocp = arm()
    row = [make(ocp, RK4()).map(3) for make in (differentiable_step, written_out)]
    hessians = [function.reverse(1).jacobian() for function in row]
    given = numbers(hessians[0], ocp)
    for ours, theirs in zip(*(hessian.call(given) for hessian in hessians), strict=True):
        largest = max(1.0, float(ca.norm_inf(ca.vec(ca.densify(theirs)))))
        np.testing.assert_allclose(np.array(ours), np.array(theirs), atol=1e-12 * largest)


def test_three_substeps_take_less_code_than_one_written_out():
    ocp = arm()
    once, thrice = (
        len(c_code(differentiable_step(ocp, RK4(steps)), along(ocp))) for steps in (1, 3)
    )
    out = len(c_code(written_out(ocp, RK4()), along(ocp)))
    assert once < out / 3
    assert thrice < 2 * out / 3
