"""The derivatives of a stage, put together, are those of the stage written out."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from models.textbook import van_der_pol
from ocp import OCP, RK4, Euler, Integrator, Midpoint
from ocp.integration.one_step import Stage
from ocp.integration.stage_hessian import stage_hessian
from tests.linear_dp.problems import unstable_mass
from tests.solvers.problems import quartic, tracker


def written_out(ocp: OCP, integrator: Integrator) -> ca.Function:
    step = Stage.of(ocp, integrator, held=True).step
    # Any: SX and DM, which the type stubs keep apart.
    inputs: Any = step.sx_in()
    after, cost = step.call(inputs, True, False)
    costate, w = ca.SX.sym("costate", ocp.model.nx), ca.vertcat(*inputs[:2])
    total = cost + ca.dot(costate, after)
    hessian, slope = ca.hessian(total, w)
    outputs = [after, cost, ca.jacobian(after, w), slope, hessian]
    return ca.Function("written_out", [*inputs, costate], outputs)


def arm() -> OCP:
    return arm_scenario("arm-001").ocp()


@pytest.mark.many
@pytest.mark.parametrize("integrator", [Euler(), Midpoint(2), RK4(), RK4(3)], ids=repr)
@pytest.mark.parametrize("make", [tracker, van_der_pol, quartic, arm, unstable_mass])
def test_every_output_is_that_of_the_stage(make, integrator):
    ocp = make()
    one, other = stage_hessian(ocp, integrator), written_out(ocp, integrator)
    assert one.size_in("x") == other.size_in(0)
    rng = np.random.default_rng(0)
    numbers = [rng.uniform(0.1, 0.9, size=one.size_in(i)) for i in range(one.n_in())]
    numbers[0] = ocp.start()[:, None] + 0.1 * numbers[0]
    for ours, theirs in zip(one.call(numbers), other.call(numbers), strict=True):
        largest = max(1.0, float(ca.norm_inf(ca.vec(ca.densify(theirs)))))
        np.testing.assert_allclose(np.array(ours), np.array(theirs), atol=1e-12 * largest)
