"""What a REPL and a notebook show: short lines, and HTML in which nothing of a user is a mark."""

from dataclasses import replace
from html.parser import HTMLParser

import casadi as ca
import numpy as np
import pytest

from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    FreeTime,
    Guess,
    Measurement,
    Model,
    Phases,
    Plant,
    Signal,
    Solution,
    Table,
    Unknown,
    estimate,
    evaluate,
    minimum_principle,
    solve,
)
from solvers import CertifyOptions, Collocation, MultipleShooting, certify, diagnose

NAME = "a <b>bold</b> & free problem"
X, U, K, W = (ca.SX.sym(name) for name in ("x<y", "u", "k", "w"))
# A line of a terminal, and a little more for names.
LONGEST = 200


def problem(**changes) -> OCP:
    given = {
        "name": NAME,
        "model": Model(name="lag", x=X, u=U, f=U - X),
        "x0": [1.0],
        "horizon": 1.0,
        "running_cost": X**2 + U**2,
        "control_bounds": Box(-2, 2),
        "constraints": (Constraint("low", X + U, upper=3.0),),
    }
    return OCP(**(given | changes))


@pytest.fixture(scope="module")
def solution() -> Solution:
    return solve(problem(), MultipleShooting(8))


@pytest.fixture(scope="module")
def things(solution: Solution) -> dict[str, object]:
    """Everything that people look at."""
    ocp = solution.problem
    mpc = MPC(ocp=ocp, solver=MultipleShooting(8), dt=0.1, compiled=False)
    rollout = mpc.run(Plant(ocp=ocp), [1.0], 0.3)
    k = Unknown("k", K, 1.0)
    data = Measurement("m", X, [0.25, 0.5, 0.75, 1.0], np.ones(4))
    decay = Model(name="fit", x=X, u=ca.SX(0, 1), f=-K * X)
    fitted = OCP(name=NAME, model=decay, x0=[1.0], horizon=1.0, unknowns=(k,), data=(data,))
    phases = Phases("two", (ocp, replace(ocp, name="second", constraints=())))
    of_phases = solve(phases, MultipleShooting(4))
    return {
        "model": ocp.model,
        "OCP": ocp,
        "free": problem(horizon=FreeTime(2.0)),
        "constraint": ocp.constraints[0],
        "signal": Signal("w", W, np.zeros(300)),
        "guess": Guess(x=np.zeros((300, 1)), duration=2.0),
        "table": Table(np.linspace(0, 1, 300), np.zeros(300), beyond="clamp"),
        "measurement": data,
        "solution": solution,
        "program": MultipleShooting(8).build(ocp),
        "evaluation": evaluate(solution),
        "principle": minimum_principle(problem(constraints=(), control_bounds=Box())),
        "certificate": certify(solution, CertifyOptions(starts=1, seconds=2)),
        "diagnosis": diagnose(solution),
        "MPC": mpc,
        "plant": Plant(ocp=ocp, lag=0.1),
        "rollout": rollout,
        "decision": rollout.decisions[0],
        "estimate": estimate(solve(fitted, Collocation(4))),
        "phases": phases,
        "solution of phases": of_phases,
        "evaluation of phases": evaluate(of_phases),
    }


def test_a_repr_is_one_short_line(things: dict[str, object]) -> None:
    long = {name: len(repr(each)) for name, each in things.items() if len(repr(each)) > LONGEST}
    assert not long
    assert not [name for name, each in things.items() if "\n" in repr(each)]


def test_reprs_say_what_matters(things: dict[str, object]) -> None:
    assert repr(things["model"]) == "<Model 'lag': 1 state (x<y), 1 control (u)>"
    assert "1 constraint, 1 s;" in repr(things["OCP"])
    assert "free final time" in repr(things["free"])
    assert repr(things["constraint"]) == "<Constraint 'low', path: (x<y+u) in [-inf] to [3.]>"
    assert repr(things["signal"]) == "<Signal 'w': samples (300, 1), held>"
    assert repr(things["guess"]) == "<Guess: x (300, 1), duration 2 s>"
    assert repr(things["table"]) == "<Table 'table': 300 samples, cubic, beyond: clamp>"
    assert repr(things["plant"]).endswith(": lag 0.1 s>")
    assert "nothing violated, 3 optimal" in repr(things["rollout"])
    assert "OPTIMAL" in repr(things["decision"])
    assert repr(things["phases"]) == f"<Phases 'two': {NAME}, second>"


class _Marks(HTMLParser):
    """Which elements there are, and whether each that is opened is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        self.seen.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.mark.parametrize(
    "name",
    ["OCP", "solution", "evaluation", "certificate", "diagnosis", "rollout", "decision",
     "estimate", "solution of phases", "evaluation of phases"],
)  # fmt: skip
def test_html_is_whole_and_escaped(things: dict[str, object], name: str) -> None:
    marks = _Marks()
    marks.feed(things[name]._repr_html_())  # type: ignore[attr-defined]
    assert not marks.open
    assert marks.seen <= {"div", "b", "table", "tr", "th", "td", "pre"}
    if name in ("OCP", "solution", "certificate", "rollout"):
        assert NAME in marks.text
    assert len(marks.text) > 20


def test_a_problem_is_shown_in_mathematics(things: dict[str, object]) -> None:
    marks = _Marks()
    marks.feed(things["OCP"]._repr_html_())  # type: ignore[attr-defined]
    assert "d(x<y)/dt = (u-x<y)" in marks.text
