"""Arcs: seen in a trajectory, shot over, and compared with closed forms."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from models.textbook import (
    double_integrator_bounded_energy,
    double_integrator_energy,
    double_integrator_minimum_time,
    exponential_fuel,
    mixed_constraint,
    turnpike,
)
from ocp import OCP, Box, Constraint, Model, Parameter, Signal, Solution, evaluate, solve
from solvers import Collocation
from solvers.certify.arc_conditions import ArcConditions
from solvers.certify.arc_shooting import ArcShooting
from solvers.certify.by_arcs import by_arcs
from solvers.certify.certificate import Verdict
from solvers.certify.control_arcs import Arc, NoArcsError, arcs_of
from solvers.certify.estimates import NoEstimateError
from solvers.certify.global_evidence import other_data
from solvers.certify.hamiltonian_check import hamiltonian_check
from solvers.certify.time_scaled_problem import TimeScaledProblem
from tests.tolerances import DERIVATIVE, STEP


def collocated(ocp: OCP, intervals: int = 81) -> Solution:
    return solve(ocp, Collocation(intervals=intervals)).or_raise()


def fewest(ocp: OCP) -> tuple[Solution, tuple[Arc, ...]]:
    answer = collocated(ocp)
    return answer, arcs_of(answer)


def test_arcs_are_seen():
    _, arcs = fewest(double_integrator_minimum_time())
    assert [arc.names for arc in arcs] == [
        ("upper bound of acceleration",),
        ("lower bound of acceleration",),
    ]
    assert arcs[0].end == arcs[1].start == pytest.approx(0.5, abs=0.02)
    assert (arcs[0].start, arcs[1].end) == (0.0, 1.0)


def test_a_constraint_on_state_and_control_is_a_law():
    answer, (arc,) = fewest(mixed_constraint())
    assert arc.names == ("sum upper",)
    m, (law,) = answer.problem.model, arc.laws
    assert law is not None
    follow = ca.Function("law", [m.x, m.t], [law.value])
    u = [float(follow(x, t)) for x, t in zip(answer.x[1:], answer.t[1:], strict=True)]
    np.testing.assert_allclose(u, answer.control(answer.t[1:])[:, 0], atol=1e-6)


CLOSED = [
    (double_integrator_minimum_time, 2.0, "indirect"),
    (double_integrator_bounded_energy, 12.5 - 50.0 / 3.0 * np.sqrt(0.15), "indirect"),
    (exponential_fuel, 1.0 - np.log(np.e - 1.0), "indirect"),
    (mixed_constraint, 1.0 / np.e - 1.0, "indirect"),
    (turnpike, 0.375, "direct"),
]


@pytest.mark.many
@pytest.mark.parametrize(("build", "optimum", "kind"), CLOSED)
def test_closed_forms(build, optimum, kind):
    """Where the control is singular on an arc, the direct method speaks."""
    estimate = by_arcs(collocated(build()))
    assert estimate.method.startswith(kind)
    assert abs(estimate.cost - optimum) <= max(estimate.error, 1e-10)
    assert estimate.violation <= 1e-8
    assert other_data(estimate.solution) == ""
    limit = 1e-9 if kind == "indirect" else 1e-6
    assert hamiltonian_check(estimate.solution, limit).verdict is Verdict.HOLDS


def test_the_jacobian_of_the_equations():
    answer, arcs = fewest(double_integrator_bounded_energy())
    shooting = ArcShooting(ArcConditions.of(answer, arcs), nodes=2, steps=4)
    value, slope = shooting.system
    w = shooting.guess()
    assert value.numel_out(0) == len(w)
    for column in (0, 5, len(w) - 3, len(w) - 1):
        step = np.zeros_like(w)
        step[column] = STEP
        difference = np.array(value(w + step) - value(w - step)).ravel() / (2 * STEP)
        np.testing.assert_allclose(
            np.array(slope(w))[:, column], difference, rtol=DERIVATIVE, atol=DERIVATIVE
        )


def test_arcs_in_the_wrong_order_are_no_extremal():
    answer, (push, brake) = fewest(double_integrator_minimum_time())
    wrong = (Arc(0.0, 0.5, brake.laws), Arc(0.5, 1.0, push.laws))
    shooting = ArcShooting(ArcConditions.of(answer, wrong))
    found = shooting.solve(shooting.guess(), 1e-10)
    lengths = found.x[-4:-2]
    assert not found.converged or lengths.min() < 0.0


def test_a_multiplier_of_the_wrong_sign_is_seen():
    answer, arcs = fewest(double_integrator_minimum_time())
    shooting = ArcShooting(ArcConditions.of(answer, arcs))
    trajectory = shooting.trajectory(shooting.solve(shooting.guess(), 1e-10).x)
    assert shooting.wrong_signs(trajectory) <= 1e-12
    turned = trajectory.with_(costate=-trajectory.costate)
    assert shooting.wrong_signs(turned) > 0.1


def test_what_is_not_said_is_said():
    with pytest.raises(NoEstimateError, match="no control is at a bound"):
        by_arcs(collocated(double_integrator_energy()))
    answer, arcs = fewest(turnpike())
    with pytest.raises(NoArcsError, match="not quadratic in u"):
        ArcConditions.of(answer, arcs)


def two_pushes(bounds: Box, *path: Constraint, x: ca.SX, u: ca.SX) -> OCP:
    """x'' = u_0 + u_1 to rest, where something else decides u_1."""
    return OCP(
        name="two pushes",
        model=Model(name="two pushes", x=x, u=u, f=ca.vertcat(x[1], u[0] + u[1])),
        x0=[1.0, 0.0],
        horizon=3.0,
        running_cost=ca.sumsqr(x) + 0.1 * u[0] ** 2,
        control_bounds=bounds,
        constraints=(*path, Constraint("rest", x, 0.0, 0.0, at="terminal")),
    )


@pytest.mark.many
@pytest.mark.parametrize("kind", ["box", "path"])
def test_an_equation_is_one_law_whose_multiplier_may_have_any_sign(kind):
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 2)
    if kind == "box":
        ocp = two_pushes(Box([-0.9, -0.1], [0.9, -0.1]), x=x, u=u)
    else:
        follow = Constraint("follow", u[1] - 0.1 * x[0], 0.0, 0.0)
        ocp = two_pushes(Box([-0.9, -9.0], [0.9, 9.0]), follow, x=x, u=u)
    answer, arcs = fewest(ocp)
    assert {arc.names[1] for arc in arcs} == {
        "equation bound of u_1" if kind == "box" else "follow equation"
    }
    assert {arc.names[0] for arc in arcs} >= {"lower bound of u_0", "free"}
    assert not [c for c in TimeScaledProblem(answer, arcs).ocp.at("path") if c.name == "follow"]
    estimate = by_arcs(answer)
    assert estimate.method.startswith("indirect")
    assert estimate.cost == pytest.approx(evaluate(answer).cost, abs=1e-4)


def test_chattering_shows_no_arcs():
    """The control jumps from bound to bound on pieces too short for an arc."""
    ocp, count = double_integrator_minimum_time(), 600
    t = np.linspace(0.0, 2.0, count + 1)
    u = np.repeat(np.where(np.arange(count) % 2, 1.0, -1.0), 2)[:, None]
    answer = collocated(ocp, 11).with_(
        t=t,
        x=np.zeros((count + 1, 2)),
        costate=np.zeros((count + 1, 2)),
        u=u,
        breaks=np.arange(count + 1),
    )
    assert arcs_of(answer) == ()
    with pytest.raises(NoEstimateError, match="no control is at a bound"):
        by_arcs(answer)


def test_names_of_the_problem_may_be_those_of_the_arcs():
    ocp = double_integrator_minimum_time()
    ends = [replace(c, name=f"end {k}") for k, c in enumerate(ocp.constraints)]
    ends[0] = replace(ends[0], name="horizon")
    other = Constraint("horizon of the arcs", ocp.model.x, -9.0, 9.0, at="terminal")
    arc = Parameter("arc", ca.SX.sym("arc"), 1.0)
    taken = replace(ocp, constraints=(*ends, other), parameters=(arc,))
    stretched = TimeScaledProblem(*fewest(taken)).ocp
    assert {entry.name for entry in stretched.parameters} == {"arc", "arc of the arcs"}
    last = stretched.constraints[-1]
    assert last.name == "horizon of the arcs of the arcs"


def test_signals_and_free_starts_are_refused():
    answer, arcs = fewest(double_integrator_minimum_time())
    ocp = answer.problem
    parts = {
        "model": ocp.model,
        "x0": ocp.x0,
        "horizon": ocp.horizon,
        "running_cost": ocp.running_cost,
        "control_bounds": ocp.control_bounds,
    }
    signal = Signal("w", ca.SX.sym("w"), np.zeros(3))
    followed = answer.with_(problem=OCP(name="w", parameters=(signal,), **parts))
    for refusing in (ArcConditions.of, TimeScaledProblem):
        with pytest.raises(NoArcsError, match="signals"):
            refusing(followed, arcs)
    start = Constraint("start", ocp.model.x, 0.0, 0.0, at="initial")
    free = answer.with_(problem=OCP(name="free", constraints=(start,), **parts))
    with pytest.raises(NoArcsError, match="start is free"):
        ArcConditions.of(free, arcs)
