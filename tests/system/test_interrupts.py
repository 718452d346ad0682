"""Ctrl-C leaves whatever runs as ``KeyboardInterrupt``, and leaves no process behind."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event, Timer

import casadi as ca
import numpy as np
import pytest

from ocp import MPC, OCP, Box, Model, Plant, Solver, evaluate, solve
from solvers import (
    Collocation,
    IndirectShooting,
    LinearMPC,
    MultipleShooting,
    Schuetz,
    StagewiseNewton,
    multistart,
    solve_many,
)
from solvers.direct.nlp_backends import CasadiNlp
from solvers.direct.subprocess_function import SUBPROCESS_SUPPORTED
from tests.mpc.problems import cart
from tests.system.problems import braking

# OSQP installs a handler of its own and asks it at the beginning of an iteration: what arrives in
# its last one is forgotten inside it, and nothing of it can be seen from here. So many of eight.
FORGOTTEN = {"osqp": 2}
# How long it is waited for a signal that was sent: far longer than any takes [s].
PATIENCE = 20.0


def hard() -> OCP:
    """A problem at which a backend works for seconds."""
    x, u = ca.SX.sym("x", 6), ca.SX.sym("u", 2)
    f = ca.vertcat(
        x[1],
        ca.sin(3 * x[0]) * x[2] + u[0],
        x[3],
        -ca.cos(2 * x[2]) * x[4] + u[1],
        x[5],
        ca.sin(x[0] * x[4]) + u[0] * u[1],
    )
    return OCP(
        name="hard",
        model=Model(name="hard", x=x, u=u, f=f),
        x0=np.ones(6),
        horizon=20.0,
        running_cost=ca.sumsqr(ca.sin(x)) + 0.01 * ca.sumsqr(u),
        terminal_cost=ca.sumsqr(x),
        control_bounds=Box(-3.0, 3.0),
    )


def implicit() -> OCP:
    """The minimising control is a root, which Newton's method of CasADi finds."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    model = Model(name="implicit", x=x, u=u, f=-x + u)
    cost = x**2 + ca.exp(u) + u**4 + 0.1 * u**2
    return OCP(name="implicit", model=model, x0=[1.0], horizon=1.0, running_cost=cost)


def large() -> OCP:
    """A linear problem at which a backend of quadratic programs works for a while."""
    n, rng = 30, np.random.default_rng(0)
    x, u = ca.SX.sym("x", n), ca.SX.sym("u", 5)
    a = np.linalg.qr(rng.normal(size=(n, n)))[0]
    model = Model(name="large", x=x, u=u, f=ca.DM(a) @ x + ca.DM(rng.normal(size=(n, 5))) @ u, dt=1)
    bounds = Box(-0.1, 0.1)
    return OCP(
        name="large",
        model=model,
        x0=np.ones(n),
        horizon=30,
        running_cost=ca.sumsqr(x) + ca.sumsqr(u),
        control_bounds=bounds,
    )


def stiff() -> OCP:
    """The referee integrates its trajectories by CVODES."""
    x, u, t = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("t")
    model = Model(name="stiff", x=x, u=u, f=-3e4 * (x - ca.cos(t)) + u, t=t)
    return OCP(name="stiff", model=model, x0=[0.0], horizon=10.0, running_cost=x**2 + 1e-3 * u**2)


def building(solver: Solver, ocp: OCP) -> Callable[[], object]:
    return lambda: solver.build(ocp)


def running(solver: Solver, ocp: OCP) -> Callable[[], object]:
    return solver.build(ocp).run


def many(ocp: OCP, solver: Solver) -> Callable[[], object]:
    starts = np.random.default_rng(0).normal(size=(64, ocp.model.nx))
    return lambda: solve_many(ocp, solver, x0=starts)


def stepping(solver: Solver, ocp: OCP) -> Callable[[], object]:
    mpc = MPC(ocp=ocp, solver=solver, dt=0.1, compiled=False)
    return lambda: mpc.step(ocp.x0, 0.0)


def looping(solver: Solver, ocp: OCP) -> Callable[[], object]:
    mpc = MPC(ocp=ocp, solver=solver, dt=0.1, compiled=False)
    return lambda: mpc.run(Plant(ocp=ocp), ocp.x0, 1.0)


def judging(ocp: OCP) -> Callable[[], object]:
    solution = solve(ocp, Collocation(25, judged=False))
    tolerances: Iterator[float] = (1e-9 * (1.0 + 1e-6 * k) for k in range(1000000))
    return lambda: evaluate(solution, tolerance=next(tolerances))


JOBS: dict[str, Callable[[], Callable[[], object]]] = {
    "build": lambda: building(MultipleShooting(40), hard()),
    "ipopt": lambda: running(MultipleShooting(100), hard()),
    "fatrop": lambda: running(MultipleShooting(40, backend="fatrop"), hard()),
    "collocation": lambda: running(Collocation(20), hard()),
    "newton": lambda: running(StagewiseNewton(100), hard()),
    "gradient": lambda: running(Schuetz.sound(), braking()),
    "indirect": lambda: running(IndirectShooting(segments=8), implicit()),
    "osqp": lambda: running(LinearMPC(), large()),
    "named": lambda: running(LinearMPC(backend="clarabel"), large()),
    "step": lambda: stepping(MultipleShooting(100), hard()),
    "loop": lambda: looping(MultipleShooting(20), cart()),
    "starts": lambda: lambda: multistart(hard(), MultipleShooting(40), starts=4, seed=0),
    "many": lambda: many(hard(), MultipleShooting(40, backend="native")),
    "referee": lambda: judging(stiff()),
}


def endlessly(job: Callable[[], object]) -> None:
    while True:
        job()


def ctrl_c(what: str, times: int) -> None:
    """Do something again and again until Ctrl-C comes out; print how often it did."""
    job = JOBS[what]()
    for k in range(times):
        sent = Event()

        def press(sent: Event = sent) -> None:
            os.kill(os.getpid(), signal.SIGINT)
            sent.set()

        try:
            Timer(0.05 + 0.037 * k, press).start()
            while not sent.is_set():
                job()
            time.sleep(PATIENCE)  # it is on its way, or lost
            print("lost")
        except KeyboardInterrupt:
            print("out")


QUICK = {"ipopt", "loop"}


@pytest.mark.parametrize(
    "what", [w if w in QUICK else pytest.param(w, marks=pytest.mark.slow) for w in JOBS]
)
def test_ctrl_c_comes_out(what: str) -> None:
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"from tests.system.test_interrupts import ctrl_c; ctrl_c('{what}', 8)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=800, check=False
    )
    lines = [line for line in done.stdout.splitlines() if line in ("out", "lost")]
    assert len(lines) == 8, done.stdout + done.stderr
    assert lines.count("lost") <= FORGOTTEN.get(what, 0), done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.skipif(not SUBPROCESS_SUPPORTED, reason="this system has no fork or no alarms")
def test_ctrl_c_ends_the_process_of_fatrop() -> None:
    solver = MultipleShooting(100, backend="fatrop", time_limit=100.0)
    program = solver.prepare(hard())
    assert isinstance(program.nlp, CasadiNlp)
    function = program.nlp.subprocess
    assert function is not None
    process = function.process
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            endlessly(program.run)
    finally:
        signal.signal(signal.SIGINT, before)
    assert not Path(f"/proc/{process}").exists()
    assert program.run().iterations, "the next run starts another one"
