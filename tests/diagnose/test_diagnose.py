"""``diagnose`` as a whole: order, text, solutions, bad input, the corpus."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.__main__ import main
from benchmarks.mistakes import MISTAKES, SOUND
from benchmarks.mistakes import problems as of
from benchmarks.mistakes.judge import GOAL, judged
from ocp import Box, Euler, Phases, ProblemError, UnsupportedProblem, solve
from solvers import Diagnosis, Finding, MultipleShooting, diagnose, polish
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Severity
from tests.ocp.problems import energy, lag, pendulum

# Where finding and plant differ, and the page says why.
MISSED = (
    "weak rotors, far target",
    "stiff spring",
    "absolute value as the root of a square",
)


def finding(cause: Cause, severity: Severity = Severity.WARNING, name: str = "x") -> Finding:
    return Finding(cause, severity, (name,), "Said.", 1.0)


def test_causes_come_before_consequences_and_advice_last():
    found = Diagnosis.of(
        "p",
        [
            finding(Cause.NOT_FINITE, Severity.ADVICE),
            finding(Cause.OUT_OF_REACH, Severity.ERROR),
            finding(Cause.DEGREES),
        ],
    )
    assert [f.cause for f in found.findings] == [
        Cause.DEGREES,
        Cause.OUT_OF_REACH,
        Cause.NOT_FINITE,
    ]
    assert len(found.serious) == 2


def test_the_first_of_two_alike_is_kept():
    twice = Diagnosis.of("p", [finding(Cause.KINK), finding(Cause.KINK)])
    assert len(twice.findings) == 1
    assert len(Diagnosis.of("p", [*twice.findings, finding(Cause.KINK, name="y")]).findings) == 2


def test_text():
    assert str(Diagnosis.of("p", [])) == "p: nothing found."
    text = str(Diagnosis.of("p", [finding(Cause.KINK)]))
    assert text == "p:\n1. WARNING: a kink or a jump, which derivatives do not see (x). Said."
    late = Finding(Cause.KINK, Severity.ERROR, ("x", "y"), "Said.", 1.0, "m", 2.5)
    assert "(x, y at t = 2.5 s)" in str(late)


@pytest.mark.slow
def test_degrees_explain_what_is_out_of_reach():
    ocp = of.pendulum(constraints=of.ends({"angle": 90.0, "rate": 0.0}), terminal_cost=0.0)
    causes = [f.cause for f in diagnose(ocp, intervals=10).findings]
    assert causes[0] is Cause.DEGREES
    assert causes[1] in (Cause.OUT_OF_REACH, Cause.CONFLICT)


@pytest.mark.slow
def test_solution_that_lives_off_its_integrator():
    rough = MultipleShooting(6, integrator=Euler(), accuracy=100.0)
    solution = solve(of.oscillator(), rough).or_raise()
    first = diagnose(solution).first
    assert first is not None
    assert first.cause is Cause.COARSE_GRID
    assert first.evidence > 0.1
    assert not diagnose(solve(of.oscillator(), MultipleShooting(50))).serious


def test_failed_solution():
    ocp = of.cart(state_bounds=Box([-np.inf, -5.0], [np.inf, 0.0]))
    failed = solve(ocp, MultipleShooting(20))
    assert not failed.status.is_success
    first = diagnose(failed, intervals=20).first
    assert first is not None
    assert first.cause is Cause.CONFLICT
    assert "velocity" in first.where


@pytest.mark.many
@pytest.mark.parametrize("build", [pendulum, lag, energy])
def test_signals_time_and_discrete_time_are_no_mistakes(build):
    assert not diagnose(build(), intervals=30).serious


def test_extremal_solution():
    direct = solve(energy(), MultipleShooting(30))
    assert not diagnose(polish(direct), intervals=30).serious


@pytest.mark.parametrize("wrong", [None, 3, "cart", of.cart])
def test_other_things_are_refused(wrong):
    with pytest.raises(ProblemError, match="takes an OCP or a Solution"):
        diagnose(wrong)


def test_phases_are_refused_by_name():
    both = of.cart(), replace(of.cart(), name="again", x0=[1.0, 0.0])
    with pytest.raises(UnsupportedProblem, match="takes no phases: diagnose each by itself"):
        diagnose(Phases("two carts", both))  # type: ignore[arg-type]


def test_nothing_is_printed(capfd):
    diagnose(of.cart(horizon=0.5), intervals=20)
    diagnose(of.tank(x0=[0.0], state_bounds=Box(0.0, 10.0)), intervals=20)
    assert capfd.readouterr() == ("", "")


def test_the_corpus_is_large_varied_and_partly_held_out():
    assert len(MISTAKES) >= 60
    assert len({m.cause for m in MISTAKES}) >= 12
    assert len({e.name for e in (*MISTAKES, *SOUND)}) == len(MISTAKES) + len(SOUND)
    assert 0.25 <= sum(m.held_out for m in MISTAKES) / len(MISTAKES) <= 0.45


def test_the_command_judges(capsys):
    assert main(["mistakes", "--only", "force times two", "--say"]) == 0
    said = capsys.readouterr().out
    assert "LINEAR_COST" in said
    assert "Was force**2 meant" in said
    assert main(["mistakes", "--only", "no such problem"]) == 2
    # A single miss is below the share that has to be named.
    assert main(["mistakes", "--only", MISSED[1]]) == 1


@pytest.mark.slow
@settings(max_examples=12, deadline=None, derandomize=True)
@given(seconds=st.floats(0.3, 3.0), ratio=st.sampled_from([0.3, 0.7, 0.9, 1.2, 2.0, 5.0]))
def test_reach_is_decided_as_by_hand(seconds, ratio):
    """Rest to rest over 1 m in T takes 4 m / T^2 newtons: more is sound, less is out of reach."""
    force = ratio * 4 * 2.0 / seconds**2
    found = diagnose(of.cart(horizon=seconds, control_bounds=Box(-force, force)), intervals=30)
    if ratio > 1.0:
        assert not found.serious
    else:
        assert found.first is not None
        assert found.first.cause is Cause.OUT_OF_REACH
        assert "end position" in found.first.where


@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize("third", range(3))
def test_the_corpus_is_diagnosed(third):
    """Each of its problems once; the numbers are those of docs/diagnose.md."""
    entries = MISTAKES[third::3]
    missed = [v.entry.name for v in judged(entries) if not v.is_right]
    assert missed == [entry.name for entry in entries if entry.name in MISSED]


def test_what_is_missed_is_little():
    assert set(MISSED) <= {m.name for m in MISTAKES}
    for entries in (MISTAKES, [m for m in MISTAKES if m.held_out]):
        assert sum(m.name not in MISSED for m in entries) >= GOAL * len(entries)


@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize("third", range(3))
def test_sound_problems_raise_no_alarm(third):
    alarms = [v.entry.name for v in judged(SOUND[third::3]) if not v.is_right]
    assert alarms == []
