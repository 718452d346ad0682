"""What peers are told is what the problem says."""

import json
import sys
from importlib import import_module
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import benchmarks.peers
from benchmarks.peers.export import exported
from benchmarks.peers.job import Job, Situation
from benchmarks.peers.tape import tape_of
from models import cart_pole_swing_up
from models.textbook import double_integrator_minimum_time
from ocp import OCP, RK4, Box, Constraint, ProblemError
from ocp.integration.one_step import Stage

SCRIPTS = Path(benchmarks.peers.__file__).parent / "scripts"


@pytest.fixture(scope="module")
def replay():
    sys.path.insert(0, str(SCRIPTS))
    try:
        yield import_module("replay")
    finally:
        sys.path.remove(str(SCRIPTS))


@given(x=st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3), y=st.floats(0.1, 2.0))
def test_a_tape_is_the_function(replay, x, y):
    a, b = ca.SX.sym("a", 3), ca.SX.sym("b")
    smooth = ca.sin(a[0]) * ca.cos(a[1]) + ca.sqrt(b) - a[2] ** 2 + ca.exp(a[0]) / b + 2 * a[1]
    kinked = ca.fmax(a[0], ca.fmin(a[1], b)) + ca.if_else(a[2] < b, a[2], -b) + ca.fabs(a[1])
    f = ca.Function("f", [a, b], [ca.vertcat(smooth, 0, kinked), a[0] ** 1.0])
    tape = json.loads(json.dumps(tape_of(f)))
    want = [np.array(v).ravel() for v in f(x, y)]
    got = replay.with_numpy(tape, [np.array(x), np.array([y])])
    again = replay.function(tape, ca)(x, y)
    for reference, number, symbolic in zip(want, got, again, strict=True):
        assert np.allclose(number, reference, rtol=1e-13, atol=1e-13)
        assert np.allclose(np.array(symbolic).ravel(), reference, rtol=1e-13, atol=1e-13)


def swing_up() -> Job:
    ocp = cart_pole_swing_up()
    situations = (Situation(ocp.start()),)
    return Job(name="c", title="cart-pole", ocp=ocp, intervals=10, situations=situations)


def test_an_exported_job_says_the_whole_problem(replay):
    job = swing_up()
    told = json.loads(json.dumps(exported(job, "s")))
    assert told["x_end"] == [1.0, np.pi, 0.0, 0.0]
    assert told["u_lower"] == [-20.0]
    assert told["x_upper"][0] == 2.0
    assert told["extremal"] is not None
    x, u, h = np.array([0.1, 2.0, -0.3, 1.0]), np.array([3.0]), 0.2
    want = Stage.of(job.ocp, RK4(), held=True).step(x, u, 0.0, h, [], [])
    got = replay.with_numpy(told["stage"], [x, u, np.zeros(1)])
    for reference, number in zip(want, got, strict=True):
        assert np.allclose(np.array(reference).ravel(), number, rtol=1e-13)


@pytest.mark.parametrize("what", ["path constraint", "free final time", "other end"])
def test_a_job_refuses_what_cannot_be_said(what):
    ocp = double_integrator_minimum_time() if what == "free final time" else _with_constraint(what)
    with pytest.raises(ProblemError, match="job j"):
        Job(name="j", title="", ocp=ocp, intervals=5, situations=(Situation(np.zeros(2)),))


def _with_constraint(what: str) -> OCP:
    base = cart_pole_swing_up()
    m = base.model
    place = "path" if what == "path constraint" else "terminal"
    constraint = Constraint("product", m.x[0] * m.x[1], 0.0, 0.0, at=place)
    return OCP(
        name="p", model=m, x0=np.zeros(4), horizon=1.0, running_cost=m.u**2,
        control_bounds=Box(-1.0, 1.0), constraints=(constraint,),
    )  # fmt: skip
