"""Who takes part: a peer behind its conversation, or one of our own solvers."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any

import numpy as np

from benchmarks.peers.conversation import Conversation, PeerFailed
from benchmarks.peers.environment import Environment
from benchmarks.peers.export import exported
from benchmarks.peers.job import Job, Situation
from benchmarks.peers.peer import PeerPackage
from benchmarks.sweep.row import versions
from ocp import Guess, Program, Solution, Solver, Status, UnsupportedProblem

# Time for an answer [s]: to build a job, which may compile, and to solve it once.
BUILD_LIMIT, SOLVE_LIMIT = 300.0, 60.0


class PeerCannotTreat(Exception):
    """A contender says that a job is none for it."""


@dataclass(frozen=True, eq=False)
class PeerAnswer:
    """One solve: its processor time [s], what came out, what its solver says."""

    seconds: float
    plan: Solution
    status: str


class Contender(ABC):
    """Somebody who builds a job once and then solves it for one situation after another."""

    name: str
    ours: bool = False
    versions: dict[str, str]
    remark: str = ""

    @abstractmethod
    def build(self, job: Job) -> float:
        """Prepare a job and return how long that took [s].

        Raises:
            CannotTreat: with the reason.
            PeerFailed: with the reason.
            NotInstalled: saying what to type.
        """

    @abstractmethod
    def solve(self, situation: Situation, *, cold: bool) -> PeerAnswer:
        """Solve for a situation: from the job's guess, or from the last answer.

        Raises:
            PeerFailed: with the reason.
        """

    def close(self) -> None:  # noqa: B027 - most hold nothing
        """Give back what it holds."""


class PeerContender(Contender):
    """A peer with one of its settings, in its own process."""

    def __init__(
        self,
        peer: PeerPackage,
        setting: str,
        environment: Environment,
        solve_limit: float = SOLVE_LIMIT,
    ) -> None:
        """Start nothing yet."""
        self.name, self.versions = peer.title(setting), {}
        self._setting, self._environment = setting, environment
        self._limit = solve_limit
        self._conversation: Conversation | None = None

    def build(self, job: Job) -> float:
        """Start its process and send it the job."""
        self._job = job
        self._conversation = Conversation(self._environment.command())
        request = {"do": "build", "job": exported(job, self._setting)}
        answer = self._conversation.ask(request, BUILD_LIMIT)
        if "cannot" in answer:
            raise PeerCannotTreat(str(answer["cannot"]))
        with _expecting(answer):
            self.versions, self.remark = dict(answer["versions"]), str(answer["remark"])
            return float(answer["seconds"])

    def solve(self, situation: Situation, *, cold: bool) -> PeerAnswer:
        """Send it a situation."""
        job = self._job
        assert self._conversation is not None, "it is built before it solves"
        request = {
            "do": "solve",
            "x0": situation.x0.tolist(),
            "p": job.along(situation),
            "guess": job.guess if cold else None,
        }
        answer = self._conversation.ask(request, self._limit)
        with _expecting(answer):
            plan = _plan(job, situation, self.name, answer)
            return PeerAnswer(float(answer["seconds"]), plan, str(answer["status"]))

    def close(self) -> None:
        """End its process."""
        if self._conversation is not None:
            self._conversation.close()


class OwnContender(Contender):
    """One of our solvers, in this process."""

    ours = True

    def __init__(self, name: str, solver: Solver, remark: str = "") -> None:
        """Build nothing yet."""
        self.name, self.remark, self._solver = name, remark, solver
        self.versions = versions()

    def build(self, job: Job) -> float:
        """Build its program."""
        began = perf_counter()
        try:
            self._program: Program = self._solver.build(job.ocp)
        except UnsupportedProblem as reason:
            raise PeerCannotTreat(str(reason)) from reason
        self._guess = Guess(x=job.guess["x"], u=job.guess["u"])
        self._last: Solution | None = None
        return perf_counter() - began

    def solve(self, situation: Situation, *, cold: bool) -> PeerAnswer:
        """Run the program."""
        start = None if cold else self._last
        began = process_time()
        plan = self._program.run(
            x0=situation.x0,
            t0=situation.t0,
            parameters=situation.parameters,
            guess=start or self._guess,
        )
        seconds = process_time() - began
        self._last = plan
        return PeerAnswer(seconds, plan, plan.status.name.lower())


@contextmanager
def _expecting(answer: Mapping[str, Any]) -> Iterator[None]:
    """Turn an answer without what it has to have into a failure of the peer."""
    try:
        yield
    except (KeyError, TypeError, ValueError) as error:
        has = ", ".join(answer)
        raise PeerFailed(f"an answer that cannot be used: {error} (it has {has})") from error


def _plan(job: Job, situation: Situation, name: str, answer: Mapping[str, Any]) -> Solution:
    """What a peer answered as a Solution.

    With costates its control is the minimiser of the Hamiltonian along them; else it is held.
    """
    x, u = np.array(answer["x"], dtype=float), np.array(answer["u"], dtype=float)
    grid = np.array(job.along(situation))[:, 0]
    t = np.array(answer.get("t", grid), dtype=float)
    has_costates = "costate" in answer
    # A solution has no NaN; the referee then finds that such controls are worth nothing.
    if not (np.isfinite(x).all() and np.isfinite(u).all()):
        raise PeerFailed(f"its answer is not finite; it says: {answer['status']}")
    return Solution(
        problem=job.ocp,
        solver=name,
        status=Status.SOLVED,
        t=t,
        x=x,
        x0=situation.x0,
        costate=np.array(answer["costate"], dtype=float) if has_costates else 0.0 * x,
        u=u,
        control_kind="extremal" if has_costates else "held",
        cost=0.0,
        parameters={k: np.asarray(v) for k, v in situation.parameters.items()},
    )
