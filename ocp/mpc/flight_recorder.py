"""The flight recorder: every step on disk as it happens, and any of them decided again."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_instance
from ocp.checks.errors import ProblemError
from ocp.closed_loop.decision import ControlRefused, Decision, InputSource
from ocp.files.append import append, sync
from ocp.files.archive import named
from ocp.files.draft import write_file
from ocp.files.frame import framed
from ocp.mpc.controller_state import Seen
from ocp.mpc.mpc import MPC
from ocp.mpc.record_file import Header, read_header, records
from ocp.mpc.record_format import Record, packed
from ocp.mpc.step_inputs import missing_measurement
from ocp.solution.solution import Solution


class FlightRecorder:
    """Writes a record after every step of an ``MPC``, whether it was decided or refused.

    The file begins with a line of JSON that says whose it is. A record is a head of fixed size,
    the shapes of its arrays, these as doubles (what was measured, the input, the step's new
    plan if there is one, the parameters), and the message; it has a number and a checksum. What
    was watched can be read again whenever the process ends; a failure of power may cost the
    last seconds, since only closing waits for the disk. Use it as a context manager and give its
    ``watch`` to the loop. A record begins with a controller that knows nothing yet: a loop
    resets it; else call ``reset``.

    Args:
        mpc: whose steps are recorded.
        path: the file; an earlier one is replaced at the first step.

    Raises:
        ProblemError: if the file cannot be written.
    """

    def __init__(self, mpc: MPC, path: str | Path) -> None:
        """Open the file."""
        check_instance(mpc, MPC, "flight recorder: mpc")
        check_instance(path, (str, Path), "the path of a flight record")
        self._mpc, self.path = mpc, Path(path)
        with named(path, "flight record", "written"):
            self._file = self.path.open("ab", buffering=0)
        self._begun, self._number, self._t = False, 0, -np.inf

    def __enter__(self) -> Self:
        """Return the recorder."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Bring the file to the disk and close it."""
        with self._file:
            sync(self._file.fileno())

    def watch(self, measured: np.ndarray, decided: Decision | ControlRefused) -> None:
        """Write down a step of the controller that has just decided, or refused.

        Raises:
            ProblemError: if it is a step of another run, or of a controller that is no ``MPC``.
            OSError: if it cannot be written (a full disk). The file ends with the step before, and
                goes on with the next one that can be written; ``records`` says which are missing.
        """
        step = decided.report if isinstance(decided, ControlRefused) else decided
        if step is None:
            raise ProblemError(f"{self.path}: a refusal of a controller that is no MPC: {decided}")
        if step.t < self._t:
            raise ProblemError(f"{self.path}: t goes back to {step.t:g} s; a record is of one run")
        self._t, number = step.t, self._number
        self._number += 1
        if not self._begun:
            self._begin()
        append(self._file.fileno(), framed(number, packed(measured, step)))

    def _begin(self) -> None:
        """Write the first line: only the loop tells the controller what acts at first."""
        mpc, acting = self._mpc, self._mpc.state.initial_input
        names = tuple(entry.name for entry in mpc.ocp.given)
        said = None if acting is None else acting.tolist()
        write_file(self.path, Header(mpc.ocp.name, repr(mpc.solver), names, said).line)
        with self._file:  # of the file that was there
            self._file = self.path.open("ab", buffering=0)
        self._begun = True


@dataclass(frozen=True, eq=False)
class Replay:
    """A step as it was and as it is when decided again.

    Attributes:
        record: from the file.
        decision: made now; None where the controller refuses now.
    """

    record: Record
    decision: Decision | None

    @property
    def is_exact(self) -> bool:
        """Whether input (to the last bit) and source are the recorded ones, or it is refused."""
        if self.decision is None or self.record.input is None:
            return self.decision is None and self.record.input is None
        return self.decision.source is self.record.source and np.array_equal(
            self.decision.input, self.record.input
        )


def replay(mpc: MPC, path: str | Path, step: int) -> Replay:
    """Decide a recorded step again, from what was known then.

    Exactly so, but for what a clock ended: a run that met its ``time_limit`` may get further now.

    Args:
        mpc: a controller of the same problem, solver and options; its memory is not touched.
        path: a file that a ``FlightRecorder`` wrote.
        step: 0 for the first record.

    Raises:
        ProblemError: if the file is not of this problem and solver, or ends before the step.
        DamagedFile: if this step or one before it is not as it was written.
    """
    return next(replay_all(mpc, path, [step]))


def replay_all(mpc: MPC, path: str | Path, steps: Iterable[int]) -> Iterator[Replay]:
    """Decide several recorded steps again, and yield them in their order; see ``replay``.

    Raises:
        ProblemError: if the file is not of this problem and solver, or ends before a step.
        DamagedFile: if a step up to the last of them is not as it was written.
    """
    check_instance(mpc, MPC, "replay: mpc")
    said = read_header(path)
    for name, kept, own in (
        ("problem", said.problem, mpc.ocp.name),
        ("solver", said.solver, repr(mpc.solver)),
    ):
        if kept != own:
            raise ProblemError(f"{path} records the {name} '{kept}', not '{own}'")
    wanted, again = set(steps), replace(mpc, parameters=_unknown)
    again.reset(said.acting)
    state = again.state
    for k, record in enumerate(records(path)):
        # A stateful solver has to run at all the steps before.
        if k in wanted or again.is_stateful:
            again.state = state
            if record.source is InputSource.REAL_TIME:
                again.prepare_next(parameters=record.parameters)
            found = Replay(record, _again(again, record))
            if k in wanted:
                wanted.remove(k)
                yield found
        if not wanted:
            return
        missing = missing_measurement(mpc.ocp, record.measured, state.seen)
        solver_ran = record.parameters_known and not missing
        state = state.after(
            record.input,
            _plan(mpc, record),
            solver_ran=solver_ran,
            meets_constraints=record.source is not InputSource.LEAST_VIOLATING,
            solver_raised=solver_ran and record.status is None,
            seen=None if missing else Seen(record.t, record.measured),
        )
    if wanted:
        raise ProblemError(f"{path} has no step {min(wanted)}")


def _unknown(t: float) -> Mapping[str, ArrayLike]:
    """Stand for the controller's ``parameters``, which failed at a recorded step."""
    raise ProblemError("they were not known at the recorded step")


def _again(mpc: MPC, record: Record) -> Decision | None:
    known = record.parameters if record.parameters_known else None
    try:
        return mpc.step(record.measured, record.t, late=record.late, parameters=known)
    except ControlRefused:
        return None


def _plan(mpc: MPC, record: Record) -> Solution | None:
    if record.plan is None:
        return None
    return Solution(
        problem=mpc.ocp,
        solver=repr(mpc.solver),
        status=record.plan.status,
        t=record.plan.t,
        x=record.plan.x,
        x0=record.plan.x0,
        costate=record.plan.costate,
        u=record.plan.u,
        control_kind=record.plan.kind,
        breaks=record.plan.breaks,
        cost=0.0,
        parameters=record.parameters,
    )
