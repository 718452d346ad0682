"""Whole certificates: true values hold, other local optima and impossible problems do not."""

from dataclasses import replace

import pytest

from benchmarks.cases import TEXTBOOK, all_cases
from models import bryson_denham, double_integrator_energy
from ocp import Box, Guess, ProblemError, UnsupportedProblem, solve
from solvers import Certificate, Effort, MultipleShooting, Verdict, certify
from solvers.certify.certificate import AGREEMENT
from solvers.certify.certify import RELATIVE
from solvers.certify.global_evidence import EXTREMALS, STARTS
from tests.certify.test_parts import integrator

QUICK = Effort(starts=1, enumerate=False)


def of(name: str, effort: Effort = QUICK) -> Certificate:
    case = next(case for case in all_cases() if case.name == name)
    return certify(solve(case.build(), MultipleShooting(75)), effort)


def verdicts(certificate: Certificate) -> dict[str, Verdict]:
    return {check.name: check.verdict for check in certificate.checks}


def test_the_energy_of_the_double_integrator_is_six():
    certificate = certify(solve(double_integrator_energy(), MultipleShooting(20)), QUICK)
    assert certificate.holds
    assert certificate.cost == pytest.approx(6.0, abs=1e-10)
    lower, upper = certificate.interval
    assert lower <= 6.0 <= upper
    assert certificate.digits >= 8
    assert "certified" in str(certificate)
    assert {check.name for check in certificate.not_checked} == {STARTS, EXTREMALS}


def test_a_certificate_is_plain_data():
    found = certify(solve(double_integrator_energy(), MultipleShooting(20)), QUICK).as_dict()
    assert found["holds"] is True
    assert len(found["estimates"]) == 2
    assert all(isinstance(check["evidence"], str) for check in found["checks"])


@pytest.mark.slow
@pytest.mark.parametrize("case", TEXTBOOK, ids=lambda case: case.name)
def test_the_textbook_is_certified(case):
    certificate = of(case.name)
    assert certificate.holds, str(certificate)
    lower, upper = certificate.interval
    assert lower - 1e-9 <= case.reference.value <= upper + 1e-9


@pytest.mark.slow
def test_a_cost_below_all_tolerances_is_not_certified():
    """Bryson and Denham's problem with 1e-10 of its cost: solvers stop anywhere."""
    ocp = bryson_denham()
    small = replace(ocp, running_cost=1e-10 * ocp.running_cost)
    certificate = certify(solve(small, MultipleShooting(20)), QUICK)
    assert verdicts(certificate)[RELATIVE] is Verdict.FAILS
    assert not certificate.holds


@pytest.mark.slow
def test_the_wrong_side_of_the_obstacle_is_found_out():
    """From zero controls the direct method ends in a local optimum of arm-034."""
    certificate = of("arm-034-sum", Effort(starts=5, enumerate=False))
    assert verdicts(certificate)[STARTS] is Verdict.FAILS
    assert not certificate.holds


@pytest.mark.slow
def test_the_extremals_of_an_arm_are_enumerated():
    certificate = of("arm-001-sum", Effort(starts=1))
    assert verdicts(certificate)[EXTREMALS] is Verdict.HOLDS
    assert verdicts(certificate)[AGREEMENT] is Verdict.HOLDS


@pytest.mark.parametrize("wrong", [{"intervals": 0}, {"starts": 0}, {"intervals": 2.5}])
def test_effort_is_checked(wrong):
    with pytest.raises(ProblemError):
        Effort(**wrong)


def test_what_no_grid_solves_is_said():
    """The end is out of reach within the bounds of the control."""
    ocp = integrator(control_bounds=Box([-0.5], [0.5]))
    start = solve(ocp, MultipleShooting(10), guess=Guess(u=[[0.0], [0.0]]))
    with pytest.raises(UnsupportedProblem, match="no grid solves it"):
        certify(start, QUICK)
