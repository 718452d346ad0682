"""Whole certificates: true values hold, other local optima and impossible problems do not."""

from dataclasses import replace
from importlib import import_module
from itertools import chain, repeat

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import TEXTBOOK, Case, all_cases
from models.textbook import bryson_denham, double_integrator_energy
from ocp import OCP, Box, Guess, Model, ProblemError, UnsupportedProblem, evaluate, solve
from solvers import Certificate, CertifyOptions, Collocation, MultipleShooting, certify
from solvers.certify.certificate import CONVEXITY, STARTS, Estimate, Verdict
from solvers.certify.estimate_checks import RELATIVE
from solvers.certify.estimates import NoEstimateError, by_polish
from solvers.certify.global_evidence import EXTREMALS, every_extremal, other_starts
from solvers.certify.grid_conditions import CHECKS as GRID
from tests.certify.test_parts import integrator

QUICK = CertifyOptions(starts=1, enumerate=False)
# Polishing the hypersensitive problem takes most of a minute: the tests of the library do it too,
# and those of the committed certificates hold its two methods against each other.
QUICKER = [case for case in TEXTBOOK if case.difficulty != "long"]


def case(name: str) -> Case:
    return next(case for case in all_cases() if case.name == name)


def verdicts(certificate: Certificate) -> dict[str, Verdict]:
    return {check.name: check.verdict for check in certificate.checks}


@pytest.fixture(scope="module")
def energy() -> Certificate:
    """Of 6, the energy of the double integrator."""
    return certify(solve(double_integrator_energy(), MultipleShooting(20)), QUICK)


def test_the_energy_of_the_double_integrator_is_six(energy):
    assert energy.holds
    assert energy.cost == pytest.approx(6.0, abs=1e-10)
    lower, upper = energy.interval
    assert lower <= 6.0 <= upper
    assert energy.digits >= 8
    assert "certified" in str(energy)
    assert {check.name for check in energy.not_checked} == {STARTS, EXTREMALS}


def test_a_certificate_is_plain_data(energy):
    found = energy.as_dict()
    assert found["holds"] is True
    assert len(found["estimates"]) == 2
    assert all(isinstance(check["evidence"], str) for check in found["checks"])


@pytest.mark.over_library
@pytest.mark.slow
@pytest.mark.parametrize("known", QUICKER, ids=lambda known: known.name)
def test_the_textbook_is_certified(known):
    certificate = certify(solve(known.build(), MultipleShooting(75)), QUICK)
    assert certificate.holds, str(certificate)
    lower, upper = certificate.interval
    assert lower - 1e-9 <= known.reference.value <= upper + 1e-9


@pytest.mark.slow
def test_a_cost_far_below_one_is_certified_as_any_other():
    """Bryson and Denham's problem with 1e-10 of its cost: in sizes of its own it is the same."""
    ocp = bryson_denham()
    small = replace(ocp, running_cost=1e-10 * ocp.running_cost)
    certificate = certify(solve(small, MultipleShooting(20)), QUICK)
    assert verdicts(certificate)[RELATIVE] is Verdict.HOLDS
    assert certificate.holds, str(certificate)
    lower, upper = certificate.interval
    reference = certify(solve(ocp, MultipleShooting(20)), QUICK).interval
    assert lower <= 1e-10 * max(reference)
    assert upper >= 1e-10 * min(reference)


@pytest.mark.slow
def test_the_wrong_side_of_the_obstacle_is_found_out():
    """From zero controls the direct method ends in a local optimum of arm-034."""
    answer = solve(case("arm-034-sum").build(), MultipleShooting(75)).or_raise()
    best = Estimate("direct", evaluate(answer).cost, 1e-3, 0.0, answer, "")
    check = other_starts(best, 3, 0, MultipleShooting(40))
    assert check.verdict is Verdict.FAILS
    certificate = Certificate("arm", (best, best), (check,))
    assert not certificate.holds
    assert "LOCAL optimum" in certificate.scope
    assert "found a cheaper one" in certificate.scope


@pytest.mark.slow
def test_the_extremals_of_an_arm_are_enumerated():
    """The cheapest of them is the polished one, which knows nothing of the scan."""
    best = by_polish(solve(case("arm-001-sum").build(), MultipleShooting(75)))
    check = every_extremal(best)
    assert check.verdict is Verdict.HOLDS
    assert check.value is not None
    assert abs(check.value) <= 1e-8


def test_what_there_was_no_time_for_is_not_checked():
    late = replace(QUICK, starts=5, seconds=1e-9)
    start = solve(double_integrator_energy(), MultipleShooting(20))
    certificate = certify(start, late)
    (estimate,) = certificate.estimates
    assert estimate.cost == pytest.approx(6.0, abs=1e-8)
    assert not certificate.holds
    left_out = {c.name for c in certificate.not_checked if "left out: the 1e-09 s" in c.sentence}
    assert left_out >= {"collocation", *GRID, STARTS}


def test_where_no_method_answers_each_says_why(monkeypatch):
    module = import_module("solvers.certify.certify")  # the package has a function of that name

    def silent(_):
        raise NoEstimateError("it has nothing to say")

    for method in ("by_polish", "by_collocation", "by_shooting"):
        monkeypatch.setattr(module, method, silent)
    start = solve(double_integrator_energy(), MultipleShooting(20))
    with pytest.raises(
        UnsupportedProblem, match=r"polish: it has .*; collocation: it has .*; arcs"
    ):
        certify(start, replace(QUICK, seconds=1e-9))


def test_the_checks_that_there_was_no_time_for_are_named(monkeypatch):
    """The clock stands still until both methods have answered; the first asks for no time."""
    instants = chain([0.0] * 2, repeat(10.0))
    module = import_module("solvers.certify.effort")
    monkeypatch.setattr(module, "perf_counter", lambda: next(instants))
    start = solve(double_integrator_energy(), MultipleShooting(20))
    certificate = certify(start, CertifyOptions(starts=5, seconds=5.0))
    left_out = {c.name for c in certificate.not_checked if "left out: the 5 s" in c.sentence}
    assert left_out == {*GRID, STARTS, EXTREMALS}
    assert len(certificate.estimates) == 2


def test_of_what_optimum_it_is_a_certificate_is_said_first(energy):
    assert "global optimum: the problem is convex" in str(energy).splitlines()[1]
    local = replace(energy, checks=tuple(c for c in energy.checks if c.name != CONVEXITY))
    assert "LOCAL optimum" in str(local).splitlines()[1]
    assert "no other start was tried" in local.scope
    assert local.as_dict()["scope"] == local.scope


@pytest.mark.parametrize(
    "wrong", [{"intervals": 0}, {"starts": 0}, {"intervals": 2.5}, {"seconds": 0.0}]
)
def test_effort_is_checked(wrong):
    with pytest.raises(ProblemError):
        CertifyOptions(**wrong)


@pytest.mark.slow
def test_what_no_grid_solves_is_said():
    """The end is out of reach within the bounds of the control."""
    ocp = integrator(control_bounds=Box([-0.5], [0.5]))
    start = solve(ocp, MultipleShooting(10), guess=Guess(u=[[0.0], [0.0]]))
    with pytest.raises(UnsupportedProblem, match="no grid solves it"):
        certify(start, QUICK)


@pytest.mark.slow
def test_stiff_dynamics_are_certified_by_two_kinds_of_collocation() -> None:
    """No explicit grid follows a lag of 0.1 ms over a second."""
    x, y, u = (ca.SX.sym(name) for name in "xyu")
    lag = Model(name="lag", x=ca.vertcat(x, y), u=u, f=ca.vertcat(u, 1e4 * (x - y)))
    stiff = OCP(name="lag", model=lag, x0=[1.0, 1.0], horizon=1.0, running_cost=y**2 + u**2)
    found = certify(solve(stiff, Collocation(25)), CertifyOptions(starts=2))
    assert found.holds, found
    assert found.cost == pytest.approx(np.tanh(1.0), rel=1e-3)
    methods = " ".join(estimate.method for estimate in found.estimates)
    assert "Radau" in methods
    assert "Gauss" in methods
    assert "explicit steps" in str(found)
