"""Programs and controllers asked from several threads: the answers are those of one thread."""

import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest

from ocp import MPC, OCP, Solver, evaluate, minimum_principle, solve
from ocp.internal import BufferedFunction
from solvers import IndirectShooting, LinearMPC, MultipleShooting, StagewiseNewton
from tests.mpc.problems import cart
from tests.ocp.problems import lag, pendulum
from tests.system.problems import EVERY, braking

each_solver = pytest.mark.parametrize(
    ("solver", "ocp"), EVERY, ids=[f"{type(s).__name__} {o.name}" for s, o in EVERY]
)


def in_a_process(code: str) -> str:
    """Run code where memory that is corrupted ends nobody else; return what it prints."""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=800, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def at_once(*jobs: Callable[[], object]) -> list:
    """Run every job in a thread of its own, all of them together."""
    barrier = Barrier(len(jobs))

    def run(job: Callable[[], object]) -> object:
        barrier.wait()
        return job()

    with ThreadPoolExecutor(len(jobs)) as threads:
        return [future.result() for future in [threads.submit(run, job) for job in jobs]]


# What two threads make of one object, and how often each asks. {runs} is filled in.
SHARED = """
import sys
from threading import Thread
from tests.system.test_threads import answers_of_{what}
before = sys.stderr, sys.stdout
print(answers_of_{what}({count}), (sys.stderr, sys.stdout) == before)
"""


def answers_of_one_program(count: int) -> bool:
    """Whether both threads get the same answers, from states of their own."""
    program = MultipleShooting(10).build(braking())
    starts = {0: [1.0, 0.0], 1: [-0.5, 0.3]}
    want = {k: program.run(x0=x0).u for k, x0 in starts.items()}
    found = at_once(
        *[lambda k=k: [program.run(x0=starts[k]).u for _ in range(count)] for k in want]
    )
    return all(np.array_equal(u, want[k]) for k in want for u in found[k])


def answers_of_two_programs(count: int) -> bool:
    """Whether two programs of one problem do not disturb each other."""
    ocp = cart()
    both = [MultipleShooting(10).build(ocp), MultipleShooting(10, backend="fatrop").build(ocp)]
    want = [program.run().u for program in both]
    found = at_once(*[lambda p=p: [p.run().u for _ in range(count)] for p in both])
    return all(np.array_equal(u, w) for w, each in zip(want, found, strict=True) for u in each)


def controllers(number: int, solver: Solver, ocp: OCP) -> list[MPC]:
    dt = ocp.model.dt or 0.1
    return [MPC(ocp=ocp, solver=solver, dt=dt, compiled=False) for _ in range(number)]


def driven(mpc: MPC, count: int) -> list[np.ndarray]:
    """The inputs of a controller that is shown states on a curve."""
    mpc.reset()
    size, inputs = mpc.ocp.model.nx, []
    for k in range(count):
        x = 0.5 * np.cos(0.3 * k + np.arange(size))
        inputs.append(mpc.step(x, k * mpc.dt).input)
    return inputs


def answers_of_two_controllers(count: int) -> bool:
    """Whether two controllers in two threads send what they send alone."""
    first, second = controllers(2, StagewiseNewton(10), braking())
    want = driven(first, count)
    found = at_once(lambda: driven(first, count), lambda: driven(second, count))
    return all(np.array_equal(a, b) for each in found for a, b in zip(each, want, strict=True))


def answers_of_one_controller(count: int) -> bool:
    """Whether every step of a controller that two threads ask has an input within bounds."""
    (mpc,) = controllers(1, StagewiseNewton(10), braking())

    def ask(k: int) -> bool:
        decision = mpc.step([0.5 * np.cos(0.3 * k), 0.1], 0.1 * k)
        return bool(np.isfinite(decision.input).all() and np.abs(decision.input).max() <= 2.0)

    halves = (range(0, count, 2), range(1, count, 2))
    found = at_once(*[lambda ks=ks: [ask(k) for k in ks] for ks in halves])
    return all(all(each) for each in found) and mpc.step([0.5, 0.1], 0.0).input.shape == (1,)


WHAT = ("one_program", "two_programs", "two_controllers", "one_controller")


@pytest.mark.many
@pytest.mark.parametrize("what", WHAT)
def test_threads_get_the_answers_of_one(what: str) -> None:
    assert in_a_process(SHARED.format(what=what, count=40)) == "True True"


@pytest.mark.slow
@pytest.mark.parametrize(
    "what",
    # The dearest is one of those that `make test` leaves to `make nightly`.
    [pytest.param(w, marks=[pytest.mark.over_library] * (w == "two_programs")) for w in WHAT],
)
def test_threads_get_the_answers_of_one_for_long(what: str) -> None:
    count = 1000 if what == "two_controllers" else 2000
    assert in_a_process(SHARED.format(what=what, count=count)) == "True True"


@pytest.mark.many
@each_solver
def test_a_program_of_every_solver_serves_two_threads(solver: Solver, ocp: OCP) -> None:
    program = solver.build(ocp)
    want = program.run()
    for solution in at_once(program.run, program.run):
        np.testing.assert_allclose(solution.u, want.u, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_two_threads_build_and_judge_one_problem() -> None:
    """What is derived once is derived by whoever comes first; the referee remembers for both."""
    for _ in range(5):
        ocp = pendulum()
        solvers = [IndirectShooting(segments=n) for n in (3, 4, 5)]
        found = at_once(*[lambda s=s, o=ocp: evaluate(solve(o, s)) for s in solvers])
        assert len({round(verdict.cost, 6) for verdict in found}) == 1
        assert minimum_principle(ocp) is minimum_principle(ocp)


def test_many_linear_programs_at_once() -> None:
    want = LinearMPC().build(lag()).run().u
    programs = [LinearMPC().build(lag()) for _ in range(4)]
    for solution in at_once(*[lambda p=p: [p.run() for _ in range(20)][-1] for p in programs]):
        np.testing.assert_allclose(solution.u, want, atol=1e-8)


def test_a_function_with_memory_of_its_own() -> None:
    function = BufferedFunction(pendulum().functions.rate.map(200))
    rng = np.random.default_rng(0)
    inputs = [[rng.normal(size=(m, 200)) for m in (2, 2, 1, 3)] for _ in range(4)]
    want = [function(*given)[0] for given in inputs]
    jobs = [lambda g=g: [function(*g)[0] for _ in range(200)] for g in inputs]
    for values, first in zip(at_once(*jobs), want, strict=True):
        assert all(np.array_equal(value, first) for value in values)
