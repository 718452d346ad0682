"""``diagnose`` where a problem has a normal form: its findings are in the words of the user."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from benchmarks.mistakes import problems as of
from benchmarks.mistakes.wrong_constants import CONSTANTS, coasting_cart, periodic_cart
from benchmarks.mistakes.wrong_meanings import MEANINGS
from ocp import Box, Constraint, Measurement, Rate, Soft, Unknown
from ocp.internal import normal_form
from solvers import Finding, diagnose
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Severity

PLANTED = {mistake.name: mistake for mistake in (*CONSTANTS, *MEANINGS)}


def first(name: str) -> Finding:
    """Return the first finding of a planted mistake, which names what was planted."""
    mistake = PLANTED[name]
    found = diagnose(mistake.build()).first
    assert found is not None
    assert (found.cause, mistake.symbol in found.where) == (mistake.cause, True), found
    return found


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("gear too weak for the time", "the bounds [0.01, 0.1] of gear"),
        ("start outside what the ramp allows", "the bounds [2, 3] of velocity at the start"),
        ("budget below what the way takes", "the integral constraint 'budget'"),
        ("gate a moment after the start", "The constraint 'gate' at 0.05 s"),
        ("gate beyond the bounds of the state", "by 6 degC"),
        ("rate per second in steps", "The bound of the rate of u"),
        ("a period of what only grows", "ends 2 away"),
        pytest.param(
            "delay as long as the horizon",
            "acts 20 steps after it is sent",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_sentences_speak_of_what_was_written(name, said):
    finding = first(name)
    assert said in finding.sentence
    assert not any("start of the states" in text for text in (finding.sentence, *finding.where))
    assert len(set(finding.where)) == len(finding.where)


def test_a_conflict_at_a_gate_is_dated_there():
    assert first("gate a moment after the start").instant == pytest.approx(0.05)
    assert "instants as much later" in first("gate a moment after the start").sentence
    assert first("gate behind the wall").instant == pytest.approx(1.0)


def test_a_period_is_no_way_to_move_what_nothing_moves():
    """A copy of the start moves with the start: on its own it would hide that a clock runs."""
    assert first("a period of what only grows").evidence == pytest.approx(2.0)
    assert not diagnose(periodic_cart(), intervals=20).serious


@pytest.mark.slow
def test_constants_that_only_a_prior_tells_apart():
    """Two of which the product acts, and a cost that knows one of them."""
    planted = PLANTED["two constants of which only the product acts"].build()
    assert first("two constants of which only the product acts").where == ("drag", "gain")
    gain = next(e.symbol for e in planted.unknowns if e.name == "gain")
    known = replace(planted, running_cost=ca.SX(planted.running_cost) + (gain - 1) ** 2)
    causes = {f.cause for f in diagnose(known, intervals=20).findings}
    assert Cause.UNIDENTIFIABLE not in causes


def test_what_data_determine_is_no_finding():
    causes = {f.cause for f in diagnose(coasting_cart(), intervals=20).findings}
    assert not causes & {Cause.UNIDENTIFIABLE, Cause.OUTLIER, Cause.NO_GOAL}


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ([0, 0, 0, 0, 1, 1, 1, 1], False),  # a step
        ([0, 0, 0, 0, 1, 0, 0, 0], True),
        ([0, 1, 2, 3, 4, 5, 6, 700], True),
        ([0, 1, np.nan, 3, 4, 5, 6, 7], False),
        ([0, 1, 900], False),  # too few to say
        (1e3 * np.exp(-np.arange(9.0)), False),
        (1e3 * np.exp(-2.0 * np.arange(9.0))[::-1], False),
        ([1e5, *np.exp(-np.arange(8.0))], True),
    ],
)
def test_outliers(values, named):
    times = 0.1 + 0.2 * np.arange(len(values))
    seen = Measurement("speed", ca.SX.sym("velocity"), times, values, 1e-4)
    ocp = of.cart(
        symbols=("drag",),
        f=lambda s: (s.velocity, s.force / 2 - s.drag),
        constraints=(),
        unknowns=lambda s: (Unknown("drag", s.drag, 0.1),),
        data=lambda s: (replace(seen, expression=s.velocity),),
    )
    found = [f for f in diagnose(ocp, intervals=10).findings if f.cause is Cause.OUTLIER]
    assert [f.where for f in found] == [("speed",)] * named


@pytest.mark.slow
def test_a_price_that_matters_is_no_finding():
    """The plant, with a price above the multiplier: met, so nothing is said."""
    planted = PLANTED["soft end at a price of nothing"].build()
    assert "by 1 without it" in first("soft end at a price of nothing").sentence
    dear = tuple(replace(c, soft=Soft(linear=50.0)) for c in planted.constraints)
    found = diagnose(replace(planted, constraints=dear), intervals=20)
    assert Cause.CHEAP_SOFT not in {f.cause for f in found.findings}


def test_a_given_start_is_tested_where_a_constant_is_free():
    """A state outside a path constraint at the start, in a problem with an unknown constant."""
    ocp = of.cart(
        symbols=("gear",),
        f=lambda s: (s.velocity, s.gear * s.force / 2),
        unknowns=lambda s: (Unknown("gear", s.gear, 1.0, 0.5, 2.0),),
        constraints=lambda s: (Constraint("ahead", s.position, lower=0.5),),
        terminal_cost=lambda s: s.gear**2,
    )
    found = diagnose(ocp, intervals=10).findings
    assert (found[0].cause, found[0].severity) == (Cause.START_VIOLATES, Severity.ERROR)
    assert "ahead" in found[0].where


def test_a_slack_or_a_copy_is_nobodys_control():
    """What the normal form adds is neither idle nor saturated to the user."""
    ocp = PLANTED["soft constraint without a bound"].build()
    names = [name for f in diagnose(ocp, intervals=20).findings for name in f.where]
    assert not any("excess" in name for name in names)


def test_every_added_name_has_an_origin():
    """But for rates, which are a word of the user."""
    ocp = of.cart(
        symbols=("gear",),
        f=lambda s: (s.velocity, s.gear * s.force / 2),
        unknowns=lambda s: (Unknown("gear", s.gear, 1.0, 0.5, 2.0),),
        rates=lambda s: (Rate(s.force, -90.0, 90.0),),
        free_start=("velocity",),
        start_bounds=Box([-np.inf, 0.0], [np.inf, 1.0]),
        constraints=lambda s: (
            Constraint("lap", s.velocity - s.start_velocity, 0.0, 0.0, at="terminal"),
            Constraint("budget", s.force**2, upper=50.0, at="integral"),
            Constraint("gate", s.position, 0.4, 0.6, at=[1.0, 1.5]),
        ),
    )
    form = normal_form(ocp)
    assert form is not None
    added = form.problem.model.x_names[ocp.model.nx :]
    assert set(added) <= set(form.origins)
    assert form.problem.model.u_names == ("rate of force",)
    assert {form.origins[name].name for name in added} == {
        "force", "velocity", "budget", "gate", "gear",
    }  # fmt: skip
