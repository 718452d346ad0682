"""A backend that loops, crashes or is killed costs its own answer only."""

import gc
import multiprocessing
import os
import pickle
import signal
import subprocess
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from threading import Timer
from typing import Any

import casadi as ca
import numpy as np
import pytest

from benchmarks.mpc.fault_problems import arm
from ocp import MPC, Compiler, ProblemError, Status
from solvers import Collocation, MultipleShooting
from solvers.direct.multiple_shooting import MultipleShootingProgram
from solvers.direct.nlp_backends import CasadiNlp
from solvers.direct.subprocess_function import (
    SUBPROCESS_SUPPORTED,
    Outputs,
    SubprocessFunction,
    SubprocessLost,
)
from tests.mpc.problems import cart

# One number in, one out; what it does depends on the sign.
MOODY = """
#include <stdlib.h>
int moody(const double** arg, double** res, long long* iw, double* w, int mem) {
  volatile double x = arg[0][0];
  while (x > 100.0) {}
  if (x < -100.0) abort();
  if (x < 0.0) return 1;
  res[0][0] = x + 1.0;
  return 0;
}
"""
LOOP, CRASH, THROW, FINE = 101.0, -101.0, -1.0, 1.0
DATA = Path(__file__).with_name("data") / "endless_fatrop.npz"

apart = pytest.mark.skipif(not SUBPROCESS_SUPPORTED, reason="this system has no fork or no alarms")


@pytest.fixture(scope="module")
def moody(tmp_path_factory: pytest.TempPathFactory) -> ca.Function:
    command = Compiler().found
    if not command:
        pytest.skip("there is no compiler")
    folder = tmp_path_factory.mktemp("moody")
    source, library = folder / "moody.c", folder / "moody.so"
    source.write_text(MOODY)
    subprocess.run([*command, "-shared", "-fPIC", source, "-o", library], check=True)
    return ca.external("moody", str(library))


def called(function: SubprocessFunction, x: float) -> float:
    outputs, _ = function({"i0": np.array([x])})
    return float(outputs["o0"][0])


@apart
@pytest.mark.parametrize(
    ("x", "word"), [(LOOP, "did not return within 0.2 s"), (CRASH, "was ended by SIGABRT")]
)
def test_a_loss_is_named_and_the_next_call_is_answered(
    moody: ca.Function, x: float, word: str
) -> None:
    function = SubprocessFunction(moody, 0.2)
    for _ in range(2):
        with pytest.raises(SubprocessLost, match=word):
            called(function, x)
        assert called(function, FINE) == 2.0


@apart
def test_an_exception_is_one_here_too(moody: ca.Function) -> None:
    function = SubprocessFunction(moody, 0.2)
    with pytest.raises(RuntimeError, match="moody"):
        called(function, THROW)
    assert called(function, FINE) == 2.0


@apart
def test_wrong_inputs_are_an_exception_that_says_so(moody: ca.Function) -> None:
    function = SubprocessFunction(moody, 0.2)
    with pytest.raises(RuntimeError, match="i7"):
        function({"i7": np.zeros(1)})
    assert called(function, FINE) == 2.0


@apart
@pytest.mark.parametrize("word", [signal.SIGKILL, signal.SIGALRM])
def test_answers_stay_with_their_questions(moody: ca.Function, word: signal.Signals) -> None:
    """Who answers may die between two calls, of memory that is short or by somebody's hand."""
    function = SubprocessFunction(moody, 5.0)
    assert called(function, FINE) == 2.0
    children = Path(f"/proc/{function.process}/task/{function.process}/children")
    if not children.exists():
        pytest.skip("this system does not list the children of a process")
    (child,) = children.read_text().split()
    os.kill(int(child), word)
    with pytest.raises(SubprocessLost):
        called(function, 10.0)
    assert [called(function, x) for x in (20.0, 30.0)] == [21.0, 31.0]


@apart
def test_the_limit_holds_where_its_owner_ignores_alarms(moody: ca.Function) -> None:
    before = signal.signal(signal.SIGALRM, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
    try:
        function = SubprocessFunction(moody, 0.2)
    finally:
        signal.signal(signal.SIGALRM, before)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGALRM})
    with pytest.raises(SubprocessLost, match="within"):
        called(function, LOOP)


@apart
def test_copies_have_processes_of_their_own(moody: ca.Function) -> None:
    function = SubprocessFunction(moody, 0.2, verbose=True)
    for copy in (deepcopy(function), pickle.loads(pickle.dumps(function))):
        assert (copy.seconds, copy.verbose) == (0.2, True)
        assert copy.process != function.process
        assert called(copy, FINE) == 2.0


@apart
def test_a_limit_of_ages_is_one(moody: ca.Function) -> None:
    assert called(SubprocessFunction(moody, 1e20), FINE) == 2.0


@apart
def test_a_server_that_does_not_start_is_a_loss(
    moody: ca.Function, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("solvers.direct.subprocess_function._SERVER", Path("nowhere.py"))
    function = SubprocessFunction(moody, 1.0)
    with pytest.raises(SubprocessLost, match="ended with its process"):
        called(function, FINE)
    monkeypatch.undo()
    assert called(function, FINE) == 2.0


@apart
def test_a_process_that_is_killed_is_replaced(moody: ca.Function) -> None:
    function = SubprocessFunction(moody, 5.0)
    os.killpg(function.process, signal.SIGKILL)
    with pytest.raises(SubprocessLost, match="its process"):
        called(function, FINE)
    assert called(function, FINE) == 2.0


@apart
def test_after_an_interruption_the_next_answer_is_its_own(moody: ca.Function) -> None:
    function = SubprocessFunction(moody, 5.0)
    # A job in the background ignores it.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    try:
        with pytest.raises(KeyboardInterrupt):
            called(function, LOOP)
    finally:
        signal.signal(signal.SIGINT, before)
    assert called(function, FINE) == 2.0


@apart
def test_a_process_that_is_stopped_is_given_up(
    moody: ca.Function, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own alarm does not reach it; and the time that it may take to start is over."""
    function = SubprocessFunction(moody, 0.2)
    monkeypatch.setattr("solvers.direct.subprocess_function._START", 1e6)
    process = function.process
    os.killpg(process, signal.SIGSTOP)
    with pytest.raises(SubprocessLost, match=r"did not return within 0\.2 s"):
        called(function, FINE)
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    assert called(function, FINE) == 2.0


@apart
def test_it_ends_with_its_owner(moody: ca.Function) -> None:
    function = SubprocessFunction(moody, 5.0)
    assert called(function, FINE) == 2.0
    process = function.process
    del function
    gc.collect()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


@pytest.fixture
def uncollected() -> Iterator[None]:
    """What is dropped ends at once, or not at all."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def open_now() -> tuple[set[str], set[str]]:
    """Children of this process, and what its descriptors are open for."""
    own = Path("/proc/self")
    children = own / "task" / str(os.getpid()) / "children"
    if not children.exists():
        pytest.skip("this system does not list the children of a process")
    return set(children.read_text().split()), set(os.listdir(own / "fd"))


def builds(count: int) -> None:
    before = open_now()
    for k in range(count):
        solver = MultipleShooting(10, backend="fatrop", time_limit=30.0)
        if k % 10:
            program = solver.build(cart())
        else:
            program = MPC(ocp=cart(), solver=solver, dt=0.1, compiled=False)
        if isinstance(program, MPC):
            program.step([1.0, 0.0], 0.0)
        elif k % 10 == 1:
            assert program.run().status is Status.SOLVED
        assert open_now() != before, "its process is running"
        del program
        assert open_now() == before


@pytest.mark.slow
@apart
def test_a_dropped_program_leaves_nothing(uncollected: None) -> None:
    builds(20)


@apart
@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize("count", [100, 500])
def test_many_dropped_programs_leave_nothing(uncollected: None, count: int) -> None:
    builds(count)


@apart
def test_a_fork_has_a_process_of_its_own(moody: ca.Function) -> None:
    function = SubprocessFunction(moody, 5.0)
    context = multiprocessing.get_context("fork")
    mine, theirs = context.Pipe()
    fork = context.Process(target=lambda: theirs.send((called(function, 2.0), function.process)))
    fork.start()
    answer, process = mine.recv()
    fork.join()
    assert fork.exitcode == 0
    assert (answer, process == function.process) == (3.0, False)
    assert called(function, FINE) == 2.0


@apart
def test_two_threads_get_their_own_answers(moody: ca.Function) -> None:
    function, found = SubprocessFunction(moody, 5.0), {}

    def ask(first: int) -> None:
        for k in range(first, first + 50):
            found[k] = called(function, k)

    threads = [Timer(0.0, ask, [first]) for first in (0, 50)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {k: k + 1.0 for k in range(100)}


# -- behind a backend -------------------------------------------------------------------------


@apart
def test_fatrop_apart_returns_the_same_numbers() -> None:
    here = MultipleShooting(20, backend="fatrop")
    first, second = (s.build(cart()).run() for s in (here, replace(here, time_limit=10.0)))
    assert first.status is second.status is Status.SOLVED
    for name in ("x", "u", "costate"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert first.iterations == second.iterations


@pytest.mark.slow
@apart
def test_fatrop_is_ended_where_it_never_returns() -> None:
    """fatrop 1.1.8, a first iterate and data recorded in a loop: no step can be computed there."""
    solver = MultipleShooting(
        8, backend="fatrop", max_iterations=40, time_limit=0.5, feasibility_restoration=False
    )
    nlp = solver.prepare(arm(()).mpc.ocp).nlp
    data = dict(np.load(DATA))
    w0, p = data.pop("w0"), data.pop("p")
    answer = nlp.solve(w0, p, data)
    assert answer.is_lost
    assert answer.return_status == "did not return within 0.5 s"
    np.testing.assert_array_equal(answer.w, w0)
    assert nlp.solve(0.0 * w0, p, data).w.shape == w0.shape, "and it goes on"


class Stuck(SubprocessFunction):
    """Without a process; after some answers there are no more."""

    def __init__(self, function: ca.Function, answers: int = 0) -> None:
        self.function, self.answers = function, answers

    def __call__(self, inputs: dict[str, np.ndarray]) -> tuple[Outputs, dict[str, Any]]:
        self.answers -= 1
        if self.answers < 0:
            raise SubprocessLost("did not return within 1 s")
        outputs = {name: np.array(v).ravel() for name, v in self.function(**inputs).items()}
        return outputs, self.function.stats()


def stuck(answers: int = 0, *, feasibility_restoration: bool = False) -> MultipleShootingProgram:
    solver = MultipleShooting(10, backend="fatrop", feasibility_restoration=feasibility_restoration)
    program = solver.prepare(cart())
    own = casadi_nlp(program)
    return replace(program, nlp=replace(own, subprocess=Stuck(own.function, answers)))


def casadi_nlp(program: MultipleShootingProgram) -> CasadiNlp:
    assert isinstance(program.nlp, CasadiNlp)
    return program.nlp


def test_a_lost_answer_is_a_failure_with_a_reason() -> None:
    solution = stuck().run()
    assert solution.status is Status.FAILED
    assert solution.message == "fatrop did not return within 1 s"
    assert solution.cost == np.inf
    assert np.isfinite(solution.x).all()


def test_feasibility_is_restored_after_a_lost_answer_as_after_any_failure() -> None:
    solution = stuck(feasibility_restoration=True).run()
    assert solution.status is Status.FAILED, "the constraints can be met, and it is lost again"
    assert "did not return" in solution.message


def test_an_answer_is_kept_where_only_its_test_is_lost() -> None:
    """From its own solution a solver does not move, and is run again from perturbed controls."""
    good = MultipleShooting(10, backend="fatrop").prepare(cart()).run()
    solution = stuck(answers=1).run(guess=good)
    assert solution.status is Status.STATIONARY
    assert "from perturbed controls, fatrop did not return" in solution.message
    assert solution.cost == pytest.approx(good.cost, rel=1e-9)


@pytest.mark.parametrize("solver", [MultipleShooting(20), Collocation(10)], ids=["ms", "colloc"])
def test_ipopt_returns_its_iterate_at_the_time_limit(solver: MultipleShooting) -> None:
    solution = (
        replace(solver, time_limit=1e-9, **_without_restoration(solver)).prepare(cart()).run()
    )
    assert solution.status is Status.TIME_LIMIT
    assert np.isfinite(solution.cost)
    assert replace(solver, time_limit=60.0).prepare(cart()).run().status is Status.SOLVED


def _without_restoration(solver: object) -> dict[str, bool]:
    return {"feasibility_restoration": False} if isinstance(solver, MultipleShooting) else {}


@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan, "soon"])
@pytest.mark.parametrize("solver", [MultipleShooting, Collocation])
def test_a_time_limit_is_a_positive_number(solver: Callable[..., object], limit) -> None:
    with pytest.raises(ProblemError, match="time_limit"):
        solver(time_limit=limit)


def test_without_a_limit_fatrop_runs_here() -> None:
    for limit in (None, np.inf):
        solver = MultipleShooting(10, backend="fatrop", time_limit=limit)
        assert casadi_nlp(solver.prepare(cart())).subprocess is None


def test_without_fork_there_is_a_warning_and_no_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("solvers.direct.nlp_backends.SUBPROCESS_SUPPORTED", False)
    solver = MultipleShooting(10, backend="fatrop", time_limit=1.0)
    with pytest.warns(UserWarning, match="time limit of fatrop"):
        program = solver.prepare(cart())
    assert casadi_nlp(program).subprocess is None
    assert program.run().status is Status.SOLVED
