"""A backend that loops, crashes or is killed costs its own answer only."""

import gc
import multiprocessing
import os
import signal
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Timer
from typing import NoReturn

import casadi as ca
import numpy as np
import pytest

from benchmarks.mpc.fault_problems import arm
from ocp import Compiler, ProblemError, Status
from solvers import Collocation, MultipleShooting
from solvers.direct.apart import POSSIBLE, Apart, Lost
from solvers.direct.backend import Nlp
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

apart = pytest.mark.skipif(not POSSIBLE, reason="this system has no fork or no alarms")


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


def called(function: Apart, x: float) -> float:
    outputs, _ = function({"i0": np.array([x])})
    return float(outputs["o0"][0])


@apart
@pytest.mark.parametrize(
    ("x", "word"), [(LOOP, "did not return within 0.2 s"), (CRASH, "was ended by SIGABRT")]
)
def test_a_loss_is_named_and_the_next_call_is_answered(
    moody: ca.Function, x: float, word: str
) -> None:
    function = Apart(moody, 0.2)
    for _ in range(2):
        with pytest.raises(Lost, match=word):
            called(function, x)
        assert called(function, FINE) == 2.0


@apart
def test_an_exception_is_one_here_too(moody: ca.Function) -> None:
    function = Apart(moody, 0.2)
    with pytest.raises(RuntimeError, match="threw"):
        called(function, THROW)
    assert called(function, FINE) == 2.0


@apart
def test_a_process_that_is_killed_is_replaced(moody: ca.Function) -> None:
    function = Apart(moody, 5.0)
    os.killpg(function.process, signal.SIGKILL)
    with pytest.raises(Lost, match="its process"):
        called(function, FINE)
    assert called(function, FINE) == 2.0


@apart
def test_after_an_interruption_the_next_answer_is_its_own(moody: ca.Function) -> None:
    function = Apart(moody, 5.0)
    Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        called(function, LOOP)
    assert called(function, FINE) == 2.0


@apart
def test_it_ends_with_its_owner(moody: ca.Function) -> None:
    function = Apart(moody, 5.0)
    assert called(function, FINE) == 2.0
    process = function.process
    del function
    gc.collect()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


@apart
def test_a_fork_has_a_process_of_its_own(moody: ca.Function) -> None:
    function = Apart(moody, 5.0)
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
    function, found = Apart(moody, 5.0), {}

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


@apart
def test_fatrop_is_ended_where_it_never_returns() -> None:
    """fatrop 1.1.8, a first iterate and data recorded in a loop: no step can be computed there."""
    solver = MultipleShooting(8, backend="fatrop", max_iterations=40, time_limit=0.5, rescue=False)
    nlp = solver.build(arm(()).mpc.ocp).search.nlp
    data = dict(np.load(DATA))
    w0, p = data.pop("w0"), data.pop("p")
    answer = nlp.solve(w0, p, data)
    assert not answer.success
    np.testing.assert_array_equal(answer.w, w0)
    assert nlp.solve(0.0 * w0, p, data).w.shape == w0.shape, "and it goes on"


class Stuck(Apart):
    """Without a process, and without answers."""

    def __init__(self) -> None:
        pass

    def __call__(self, inputs: dict[str, np.ndarray]) -> NoReturn:
        raise Lost("did not return within 1 s")


def test_a_lost_answer_is_a_failure_with_a_reason() -> None:
    program = MultipleShooting(10, backend="fatrop", rescue=False).build(cart())
    own = program.search.nlp
    program.search.__dict__["nlp"] = Nlp(own.function, own.verbose, Stuck())
    solution = program.run()
    assert solution.status is Status.FAILED
    assert solution.message == "fatrop did not return within 1 s"
    assert solution.cost == np.inf
    assert np.isfinite(solution.x).all()


@pytest.mark.parametrize("solver", [MultipleShooting(20), Collocation(10)], ids=["ms", "colloc"])
def test_ipopt_returns_its_iterate_at_the_time_limit(solver: MultipleShooting) -> None:
    solution = replace(solver, time_limit=1e-9, **_without_rescue(solver)).build(cart()).run()
    assert solution.status is Status.TIME_LIMIT
    assert np.isfinite(solution.cost)
    assert replace(solver, time_limit=60.0).build(cart()).run().status is Status.SOLVED


def _without_rescue(solver: object) -> dict[str, bool]:
    return {"rescue": False} if isinstance(solver, MultipleShooting) else {}


@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan, "soon"])
@pytest.mark.parametrize("solver", [MultipleShooting, Collocation])
def test_a_time_limit_is_a_positive_number(solver: Callable[..., object], limit) -> None:
    with pytest.raises(ProblemError, match="time_limit"):
        solver(time_limit=limit)


def test_without_a_limit_fatrop_runs_here() -> None:
    for limit in (None, np.inf):
        solver = MultipleShooting(10, backend="fatrop", time_limit=limit)
        assert solver.build(cart()).search.nlp.apart is None


def test_without_fork_there_is_a_warning_and_no_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("solvers.direct.backend.POSSIBLE", False)
    solver = MultipleShooting(10, backend="fatrop", time_limit=1.0)
    with pytest.warns(UserWarning, match="time limit of fatrop"):
        program = solver.build(cart())
    assert program.search.nlp.apart is None
    assert program.run().status is Status.SOLVED
