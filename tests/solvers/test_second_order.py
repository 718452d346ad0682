"""Conjugate points where they are known, and passes on minima."""

import re

import casadi as ca
import numpy as np
import pytest

from models.textbook import double_integrator_energy, van_der_pol
from ocp import OCP, Constraint, Model, Solution, Status, solve
from solvers import IndirectShooting, MultipleShooting, SecondOrder, polish
from tests.solvers.problems import circle_start, oscillator, saturated_transfer, timed_transfer

STEPS = 300


def judged(ocp: OCP, segments: int = 1) -> tuple[Solution, SecondOrder]:
    program = IndirectShooting(segments=segments, steps=STEPS).prepare(ocp)
    solution = program.run()
    assert solution.status is Status.STATIONARY
    return solution, program.second_order(solution)


@pytest.mark.parametrize("make", [van_der_pol, double_integrator_energy])
def test_passes_on_a_minimum(make) -> None:
    _, verdict = judged(make())
    assert verdict == SecondOrder(True)


def test_passes_with_a_saturated_control() -> None:
    assert judged(saturated_transfer()[0])[1].passed


@pytest.mark.many
@pytest.mark.parametrize(("size", "segments"), [(1, 1), (2, 1), (3, 4)])
@pytest.mark.parametrize(
    ("fixed", "before_end", "durations"),
    [(True, np.pi, (3.0, 3.1, 3.2, 4.0, 7.0)), (False, np.pi / 2, (1.5, 1.55, 1.6, 2.0, 5.0))],
)
def test_conjugate_point_of_the_oscillator(
    size: int, segments: int, fixed: bool, before_end: float, durations: tuple[float, ...]
) -> None:
    """One point for all directions at once too: det X does not change its sign there for two."""
    for duration in durations:
        _, verdict = judged(oscillator(duration, fixed=fixed, size=size), segments)
        if duration < before_end:
            assert verdict.passed
            continue
        assert verdict.passed is False
        match = re.search(r"conjugate point near t = (\S+) s", verdict.reason)
        assert match
        # Seen at the first node before it, 300 steps to the horizon.
        assert float(match[1]) == pytest.approx(duration - before_end, abs=1.1 * duration / STEPS)


def test_legendre_fails_where_the_hamiltonian_turns_concave() -> None:
    """H_uu = 2 (1.001 - t): a control costs nothing to speak of from t = 1.001 on."""
    t = ca.SX.sym("t")
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    ocp = OCP(
        name="turning",
        model=Model(name="turning", x=x, u=u, f=u, t=t),
        x0=0.0,
        horizon=2.0,
        running_cost=(1.001 - t) * u**2 + x**2,
    )
    program = IndirectShooting(segments=1, steps=STEPS).prepare(ocp)
    solution = program.run()
    assert solution.status is Status.FAILED
    assert solution.message == "the control is no minimum of the Hamiltonian at t = 1.007 s"
    verdict = program.second_order(solution)
    assert verdict.passed is False
    assert verdict.reason == "H_uu is not positive definite at t = 1.007 s"


def test_start_manifold() -> None:
    """On the circle the nearest start is a minimum and the farthest is none."""
    nearest, verdict = judged(circle_start((0.9, 0.1)))
    assert verdict.passed
    np.testing.assert_allclose(nearest.x[0], [1.0, 0.0], atol=1e-9)
    assert nearest.cost == pytest.approx(0.25)
    farthest, verdict = judged(circle_start((-1.0, 0.0)))
    assert farthest.cost == pytest.approx(2.25)
    assert verdict.passed is False
    assert "start manifold" in verdict.reason


def test_free_final_time_is_not_judged() -> None:
    direct = solve(timed_transfer(), MultipleShooting(40))
    solution = polish(direct)
    assert solution.status is Status.STATIONARY
    assert "free final time" in solution.message


def test_polish_says_why_an_extremal_is_no_minimum() -> None:
    ocp = oscillator(4.0, fixed=True)
    solution = polish(solve(ocp, IndirectShooting()))
    assert solution.status is Status.STATIONARY
    assert "conjugate point" in solution.message


@pytest.mark.parametrize(
    ("duration", "fixed_end"), [(np.pi, False), (np.pi / 2, False), (np.pi, True)]
)
def test_a_conjugate_point_on_a_node_is_seen(duration: float, fixed_end: bool) -> None:
    """L = (u^2 - x^2) / 2: X = cos(T - t) with a free end, sin(T - t) with a fixed one.

    Its zeros are at T - t = pi / 2, in the middle or at t0, and at T - t = pi, at t0.
    """
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    end = (Constraint("end", x, 0.0, 0.0, at="terminal"),) if fixed_end else ()
    ocp = OCP(
        name="oscillator",
        model=Model(name="oscillator", x=x, u=u, f=u),
        x0=0.0,
        horizon=duration,
        running_cost=(u**2 - x**2) / 2,
        constraints=end,
    )
    _, verdict = judged(ocp)
    assert verdict.passed is False
    assert verdict.reason.startswith("conjugate point")


@pytest.mark.parametrize("scale", [1.0, 3.0, 1e-3])
def test_the_scale_of_a_terminal_equation_does_not_matter(scale: float) -> None:
    """A copy p of the start that the end fixes: nothing is left free at the start."""
    x, p, u = ca.SX.sym("x"), ca.SX.sym("p"), ca.SX.sym("u")
    ocp = OCP(
        name="linked",
        model=Model(name="linked", x=ca.vertcat(x, p), u=u, f=ca.vertcat(u, 0)),
        x0=[1.0, 1.0],
        horizon=1.0,
        running_cost=x**2 + u**2,
        constraints=(
            Constraint("copy", x - p, 0, 0, at="initial"),
            Constraint("p", scale * (p - 1), 0, 0, at="terminal"),
        ),
    )
    polished = polish(solve(ocp, MultipleShooting(100)))
    assert polished.status is Status.SOLVED
    assert polished.cost == pytest.approx(np.tanh(1.0), abs=1e-9)


@pytest.mark.parametrize(("duration", "passes"), [(2.0, True), (3.0, True), (3.3, False)])
def test_a_state_that_only_the_end_fixes_hides_no_conjugate_point(
    duration: float, passes: bool
) -> None:
    """a = 0 is the minimum up to pi; w is constant, free at the start and given at the end."""
    a, w, b = ca.SX.sym("a"), ca.SX.sym("w"), ca.SX.sym("b")
    ocp = OCP(
        name="pinned",
        model=Model(name="pinned", x=ca.vertcat(a, w), u=b, f=ca.vertcat(w * b, 0)),
        x0=[0.0, 1.0],
        horizon=duration,
        running_cost=w * (b**2 - a**2) / 2,
        constraints=(
            Constraint("from", a, 0, 0, at="initial"),
            Constraint("to", ca.vertcat(a, w), [0, 1], [0, 1], at="terminal"),
        ),
    )
    _, verdict = judged(ocp)
    assert verdict.passed is passes
