"""One file of every kind that is written and read again, and what is read from it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.cases.library.certificates import Certificates
from benchmarks.methods.method import Settings
from benchmarks.mpc.loop_row import LoopRow, read_loops
from benchmarks.peers import BadResults, Entry, PeerReport
from benchmarks.sweep.row import CRASHED, Row
from benchmarks.sweep.rows_file import read_found
from benchmarks.sweep.task import SweepTask
from ocp import (
    MPC,
    OCP,
    DamagedFile,
    Decision,
    FlightRecorder,
    Plant,
    Rollout,
    Solution,
    Status,
    records,
)
from solvers import MultipleShooting
from tests.mpc.problems import cart

STEPS = 6


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        write: writes an example.
        read: returns what is in it.
        error: the one that damage may raise; without it, a part may be read.
        in_parts: whether what is read is a sequence of which some may be missing.
    """

    write: Callable[[Path], object]
    read: Callable[[Path], Any]
    error: type[Exception] = DamagedFile
    in_parts: bool = False


@cache
def problem() -> OCP:
    return cart()


@cache
def controller() -> MPC:
    return MPC(ocp=problem(), solver=MultipleShooting(5), dt=0.1)


@cache
def solution(cost: float = 0.1 + 0.2) -> Solution:
    rng = np.random.default_rng(0)
    return Solution(
        problem=problem(),
        solver="by hand",
        status=Status.SOLVED,
        message="a message",
        t=np.linspace(0.0, 1.0, 6),
        x=rng.normal(size=(6, 2)),
        x0=np.zeros(2),
        costate=rng.normal(size=(6, 2)),
        u=rng.normal(size=(5, 1)),
        cost=cost,
        history={"cost": rng.normal(size=7)},
    )


@cache
def rollout() -> Rollout:
    return controller().run(Plant(ocp=problem(), measurement_noise=0.01), [1.0, 0.0], 0.1 * STEPS)


def decision(number: int) -> Decision:
    return replace(rollout().decisions[0], t=0.1 * number)


def record(file: Path) -> None:
    with FlightRecorder(controller(), file) as recorder:
        for k in range(STEPS):
            recorder.watch(np.array([k, 0.5]), decision(k))


def row(number: int) -> Row:
    task = SweepTask("textbook", f"case {number}", "direct-75", "", Settings())
    return Row.lost(task, CRASHED, "a test", 0.1 * number)


def append_rows(file: Path) -> None:
    for k in range(STEPS):
        row(k).append_to(file)


def append_loops(file: Path) -> None:
    for horizon in (0.1, 0.2, 0.3):
        LoopRow.of("arm-001", "direct", horizon, rollout()).append_to(file)


REPORT = PeerReport(
    machine={"cores": "2"},
    load=[0.5, 0.6],
    titles={"j": "a job"},
    entries=(Entry(job="j", contender="c", versions={"p": "1"}, outcome="measured", cost=0.3),),
)
ENTRY = {"holds": True, "cost": 0.1 + 0.2, "digits": 9}
CERTIFICATES = Certificates().with_("one", ENTRY, {"p": "1"}).with_("two", ENTRY, {"p": "2"})

KINDS: Mapping[str, Kind] = {
    "solution.npz": Kind(
        lambda file: solution().save(file), lambda file: Solution.load(file, problem())
    ),
    "rollout.npz": Kind(
        lambda file: rollout().save(file), lambda file: Rollout.load(file, problem())
    ),
    "flight": Kind(record, lambda file: tuple(records(file)), in_parts=True),
    "results.jsonl": Kind(append_rows, lambda file: read_found(file).rows, in_parts=True),
    "loops.jsonl": Kind(append_loops, read_loops, in_parts=True),
    "certificates.json": Kind(CERTIFICATES.write, Certificates.read),
    "peers.json": Kind(REPORT.write, PeerReport.read, BadResults),
}


def same(one: Any, other: Any) -> bool:
    """Whether two things are equal to the last bit, also where they have arrays in them."""
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    if isinstance(one, OCP):
        return one is other
    if is_dataclass(one) and type(one) is type(other):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, Sequence) and not isinstance(one, str):
        return len(one) == len(other) and all(map(same, one, other))
    return type(one) is type(other) and bool(one == other or (one != one and other != other))


def function(number: int) -> ca.Function:
    """A function of its own for every number."""
    x = ca.SX.sym("x")
    return ca.Function("f", [x], [ca.sin(x) + 0.5 * number])
