"""The problems in phases: each complete, each reference found again by the methods it declares."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from benchmarks.cases import LIBRARY, PHASES, PhasesCase, all_cases
from benchmarks.cases.library.table import phases_table
from benchmarks.methods.library_tolerances import COLLOCATION, DIRECT_COARSE, EXTREMAL, Tolerance
from models.textbook.bouncing_ball import BOUNCE, GRAVITY, HEIGHT, TOTAL
from ocp import PhasesEvaluation, evaluate, solve
from solvers import Collocation, MultipleShooting, polish
from tests.tolerances import ROUNDING

each = pytest.mark.parametrize("case", PHASES, ids=lambda case: case.name)
CASES = {case.name: case for case in PHASES}
# Intervals of each phase.
SHOOTING, POINTS = 40, 16
# What has tests of its own, with two families of points: tests/phases/test_staged_ascent.py.
ELSEWHERE = {"staged-ascent"}


def declaring(family: str) -> list[str]:
    return [c.name for c in PHASES if family in c.families and c.name not in ELSEWHERE]


def within(case: PhasesCase, verdict: PhasesEvaluation, tolerance: Tolerance) -> None:
    reference, (far, violated) = case.reference, tolerance
    assert reference is not None
    outside = max(verdict.cost - reference.upper, reference.lower - verdict.cost, 0.0)
    assert outside <= far * abs(reference.value)
    assert verdict.violation <= violated, verdict.worst


@each
def test_a_case_is_complete(case: PhasesCase) -> None:
    phases = case.build()
    assert len(phases.phases) > 1
    assert case.name not in {other.name for other in all_cases()}
    assert case.source
    assert case.families
    assert case.reference is not None
    assert case.reference.error <= 1e-6 * max(1.0, abs(case.reference.value))


@pytest.mark.parametrize("name", declaring("direct"))
def test_direct_confirms_the_reference(name: str) -> None:
    case = CASES[name]
    verdict = evaluate(solve(case.build(), MultipleShooting(SHOOTING)).or_raise())
    far, _ = DIRECT_COARSE[case.difficulty]
    within(case, verdict, (far, 1e-3))


@pytest.mark.slow
@pytest.mark.parametrize("name", declaring("collocation"))
def test_collocation_confirms_the_reference(name: str) -> None:
    case = CASES[name]
    solved = solve(case.build(), Collocation(6)).or_raise()
    found = solve(case.build(), Collocation(POINTS), guess=solved).or_raise()
    far, _ = COLLOCATION[case.difficulty]
    within(case, evaluate(found), (far, 1e-5))


@pytest.mark.slow
@pytest.mark.parametrize("name", declaring("polish"))
def test_an_extremal_confirms_the_reference(name: str) -> None:
    case = CASES[name]
    found = polish(solve(case.build(), MultipleShooting(SHOOTING))).or_raise()
    within(case, evaluate(found), EXTREMAL[case.difficulty])


def bounce(z: np.ndarray) -> float:
    """Return the cost of cubic flights between impacts with two speeds, after two times."""
    first, second, fall, flight = z
    cost = 0.0
    for d, v, w, time in (
        (-HEIGHT, 0.0, -first, fall),
        (0.0, BOUNCE * first, -second, flight),
        (HEIGHT, BOUNCE * second, 0.0, TOTAL - fall - flight),
    ):
        cost += 2.0 * (v**2 + v * w + w**2) / time - 6.0 * d * (v + w) / time**2
        cost += 6.0 * d**2 / time**3 + GRAVITY * (w - v) + GRAVITY**2 * time / 2.0
    return float(cost)


def test_the_ball_costs_as_its_cubic_flights() -> None:
    found = minimize(bounce, [4.0, 4.0, 0.5, 1.4], method="BFGS", options={"gtol": 1e-10})
    reference = CASES["bouncing-ball"].reference
    assert reference is not None
    assert found.fun == pytest.approx(reference.value, rel=2 * ROUNDING, abs=reference.error)


def test_the_arcs_of_the_car_cost_what_the_car_costs() -> None:
    (car,) = [case for case in LIBRARY if case.name == "car-minimum-time"]
    one, arcs = car.reference, CASES["car-in-arcs"].reference
    assert one is not None
    assert arcs is not None
    assert one.value == arcs.value


def test_the_page_holds_the_table() -> None:
    page = (Path(__file__).parents[2] / "docs" / "library.md").read_text(encoding="utf-8")
    assert phases_table() in page
