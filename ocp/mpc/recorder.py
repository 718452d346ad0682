"""The flight recorder: every step on disk as it happens, and any of them played again."""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, NamedTuple, Self

import numpy as np

from ocp.errors import ProblemError
from ocp.mpc.decision import ControlRefused, Decision, Outcome
from ocp.mpc.driver import MPC
from ocp.mpc.memory import Memory
from ocp.solution import Solution
from ocp.status import Status

_FORMAT = "flight record, version 1"
_PLAN = ("t", "x", "x0", "costate", "u", "breaks")


class FlightRecorder:
    """Writes a record after every decision of an ``MPC``.

    The file begins with a line of JSON that says whose it is. A record is a line of JSON with
    everything that is not an array, and then the arrays as doubles: what was measured, the
    parameters, the input, and the plan where it is another one than before. A record that was
    cut off by a crash is ignored later. Use it as a context manager and give its ``watch`` to
    the loop.

    Args:
        mpc: whose decisions are recorded.
        path: the file, overwritten.
    """

    def __init__(self, mpc: MPC, path: str | Path) -> None:
        """Open the file."""
        self._mpc, self.path = mpc, Path(path)
        self._last: Solution | None = None
        self._file: BinaryIO = self.path.open("wb")
        header = {"format": _FORMAT, "problem": mpc.ocp.name, "solver": repr(mpc.solver)}
        self._file.write(json.dumps(header).encode() + b"\n")

    def __enter__(self) -> Self:
        """Return the recorder."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file."""
        self._file.close()

    def watch(self, measured: np.ndarray, decision: Decision) -> None:
        """Write down a step of the controller that has just decided."""
        arrays = {"measured": measured, "input": decision.input}
        arrays |= {f"p/{name}": value for name, value in decision.parameters.items()}
        entry: dict[str, Any] = {
            "t": decision.t,
            "outcome": decision.outcome.name,
            "status": decision.status.name if decision.status else None,
            "late": decision.late,
            "informed": decision.is_informed,
            "message": decision.message,
            "age": decision.age,
            "clipped": decision.clipped,
            "residual": decision.residual,
            "time_used": decision.time_used,
        }
        plan = self._mpc.memory.plan
        if plan is not None and plan is not self._last:
            entry["plan"] = {"kind": plan.control_kind, "status": plan.status.name}
            arrays |= {f"plan/{name}": getattr(plan, name) for name in _PLAN}
            self._last = plan
        entry["arrays"] = {name: np.shape(array) for name, array in arrays.items()}
        body = b"".join(np.ascontiguousarray(a, dtype=float).tobytes() for a in arrays.values())
        self._file.write(b"%s\n%s" % (json.dumps(entry).encode(), body))
        self._file.flush()


class Record(NamedTuple):
    """One step from the file: what is not an array, and the arrays by name."""

    entry: Mapping[str, Any]
    arrays: Mapping[str, np.ndarray]

    @property
    def outcome(self) -> Outcome:
        """Which rung the input came from."""
        return Outcome[self.entry["outcome"]]

    @property
    def input(self) -> np.ndarray:
        """What was sent (m,)."""
        return self.arrays["input"]


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
        """Whether input (to the last bit) and outcome are the recorded ones."""
        return (
            self.decision is not None
            and self.decision.outcome is self.record.outcome
            and np.array_equal(self.decision.input, self.record.input)
        )


def records(path: str | Path) -> Iterator[Record]:
    """Yield the complete records of a file, in order.

    Raises:
        ProblemError: if it is no flight record.
    """
    with Path(path).open("rb") as file:
        _header(file, path)
        while line := file.readline():
            try:
                entry = json.loads(line)
            except (json.JSONDecodeError, UnicodeDecodeError):
                return
            arrays = {}
            for name, shape in entry["arrays"].items():
                count = int(np.prod(shape))
                raw = file.read(8 * count)
                if len(raw) < 8 * count:
                    return
                arrays[name] = np.frombuffer(raw).reshape(shape)
            yield Record(entry, arrays)


def replay(mpc: MPC, path: str | Path, step: int) -> Replay:
    """Decide a recorded step again, from what was known then.

    Args:
        mpc: a controller of the same problem, solver and options; its memory is not touched.
        path: a file that a ``FlightRecorder`` wrote.
        step: 0 for the first record.

    Raises:
        ProblemError: if the file is not of this problem and solver, or ends before the step.
    """
    return next(replay_all(mpc, path, [step]))


def replay_all(mpc: MPC, path: str | Path, steps: Iterable[int]) -> Iterator[Replay]:
    """Decide several recorded steps again, and yield them in their order; see ``replay``.

    Raises:
        ProblemError: if the file is not of this problem and solver, or ends before a step.
    """
    with Path(path).open("rb") as file:
        header = _header(file, path)
    for name, own in (("problem", mpc.ocp.name), ("solver", repr(mpc.solver))):
        if header[name] != own:
            raise ProblemError(f"{path} records the {name} '{header[name]}', not '{own}'")
    wanted, known = set(steps), _Known()
    again, memory = replace(mpc, parameters=known), Memory()
    for k, record in enumerate(records(path)):
        if not wanted:
            return
        # What a solver remembers comes from all the steps before.
        if k in wanted or again.remembers:
            again.memory, known.record = memory, record
            found = Replay(record, _again(again, record))
            if k in wanted:
                wanted.remove(k)
                yield found
        memory = memory.after(record.input, _plan(mpc, record), mpc.steps_late)
    if wanted:
        raise ProblemError(f"{path} has no step {min(wanted)}")


def _header(file: BinaryIO, path: str | Path) -> dict[str, str]:
    try:
        header = json.loads(file.readline())
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ProblemError(f"{path} is no flight record") from error
    if not isinstance(header, dict) or header.get("format") != _FORMAT:
        raise ProblemError(f"{path} is no {_FORMAT}")
    return header


@dataclass(eq=False)
class _Known:
    """The parameters as they were known at a recorded step, instead of the controller's own."""

    record: Record | None = None

    def __call__(self, t: float) -> dict[str, np.ndarray]:
        if self.record is None or not self.record.entry["informed"]:
            raise ProblemError("nobody knew them")
        return _parameters(self.record)


def _again(mpc: MPC, record: Record) -> Decision | None:
    try:
        return mpc.step(
            record.arrays["measured"],
            record.entry["t"],
            late=record.entry["late"],
        )
    except ControlRefused:
        return None


def _parameters(record: Record) -> dict[str, np.ndarray]:
    return {name[2:]: array for name, array in record.arrays.items() if name.startswith("p/")}


def _plan(mpc: MPC, record: Record) -> Solution | None:
    if "plan" not in record.entry:
        return None
    held = record.arrays
    t, x, x0, costate, u = (held[f"plan/{name}"] for name in _PLAN if name != "breaks")
    return Solution(
        problem=mpc.ocp,
        solver=repr(mpc.solver),
        status=Status[record.entry["plan"]["status"]],
        t=t,
        x=x,
        x0=x0,
        costate=costate,
        u=u,
        breaks=held.get("plan/breaks", np.empty(0)),  # files of before there were any
        control_kind=record.entry["plan"]["kind"],
        cost=0.0,
        parameters=_parameters(record),
    )
