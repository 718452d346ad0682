"""One step of a controller as bytes, and back."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from struct import Struct, pack
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from ocp.checks.errors import ProblemError
from ocp.closed_loop.decision import Decision, InputSource, StepReport
from ocp.solution.archive import opened
from ocp.solution.solution import ControlKind
from ocp.solution.status import Status

_FORMAT = "flight record, version 3"  # the enums below belong to it
# Bytes that follow; t, residual, clipped, time used; age; source, status, late, informed,
# kind and status of the plan, number of arrays.
_HEAD = Struct("<I4di7B")
_SHAPE = Struct("<2i")
# Instead of the number of columns: the array has one axis.
_VECTOR = -1
# A place in one of these is a byte of the head; the first entry of each: there is none.
_SOURCES: tuple[InputSource | None, ...] = (
    None,
    InputSource.OPTIMAL,
    InputSource.FEASIBLE,
    InputSource.SHIFTED,
    InputSource.BACKUP,
    InputSource.LEAST_VIOLATING,
)
_STATUSES: tuple[Status | None, ...] = (None, *Status)
_KINDS: tuple[ControlKind | None, ...] = (
    None,
    "held",
    "linear",
    "polynomial",
    "extremal",
)


class Plan(NamedTuple):
    """A plan without its problem; see ``Solution``."""

    kind: ControlKind
    status: Status
    t: np.ndarray
    x: np.ndarray
    x0: np.ndarray
    costate: np.ndarray
    u: np.ndarray
    breaks: np.ndarray


_ARRAYS = Plan._fields[2:]


class Record(NamedTuple):
    """One step from the file; see ``Decision``.

    Attributes:
        t: when the state was measured [s].
        source: which rung the input came from; None where the step was refused.
        status: how the solver ended.
        message: why the input is not ``OPTIMAL``.
        measured: what the controller was told (nx,).
        input: what was sent (m,); None where the step was refused.
        parameters: as they were known.
        plan: the new plan of this step, if there is one.
        late: whether the new plan came too late for the step.
        parameters_known: whether the parameters were known.
        residual: of the solver.
        clipped: by how much the input was clipped.
        age: of the plan that was followed, in steps.
        time_used: [s].
    """

    t: float
    source: InputSource | None
    status: Status | None
    message: str
    measured: np.ndarray
    input: np.ndarray | None
    parameters: Mapping[str, np.ndarray]
    plan: Plan | None
    late: bool
    parameters_known: bool
    residual: float
    clipped: float
    age: int
    time_used: float

    @property
    def is_solvable(self) -> bool:
        """Whether the solver had what it needs."""
        return self.parameters_known and bool(np.isfinite(self.measured).all())


def header(
    problem: str, solver: str, parameters: Sequence[str], acting: np.ndarray | None
) -> bytes:
    """Return the first line of a file: whose it is, and what acted before the first decision."""
    said = {
        "format": _FORMAT,
        "problem": problem,
        "solver": solver,
        "parameters": [*parameters],
        "acting": None if acting is None else acting.tolist(),
    }
    return json.dumps(said).encode() + b"\n"


def packed(measured: np.ndarray, step: StepReport) -> bytes:
    """Return a step, with its measurement and new plan, as bytes."""
    plan = step.new_plan
    decision = step if isinstance(step, Decision) else None
    arrays = [measured]
    if decision:
        arrays.append(decision.input)
    if plan:
        arrays += (plan.t, plan.x, plan.x0, plan.costate, plan.u, plan.breaks)
    arrays += step.parameters.values()
    # Contiguous, so that their bytes can be joined from where they are.
    arrays = [np.asarray(array, dtype=float, order="C") for array in arrays]
    sizes = []
    for array in arrays:
        sizes += array.shape if array.ndim == 2 else (len(array), _VECTOR)
    # As many as len(arrays) times _SHAPE, at once.
    shapes = pack(f"<{len(sizes)}i", *sizes)
    message = step.message.encode()
    head = _HEAD.pack(
        len(shapes) + sum([array.nbytes for array in arrays]) + len(message),
        step.t,
        step.residual,
        decision.clipped if decision else 0.0,
        step.time_used,
        decision.age if decision else 0,
        _SOURCES.index(decision.source if decision else None),
        _STATUSES.index(step.status),
        step.late,
        step.parameters_known,
        _KINDS.index(plan.control_kind if plan else None),
        _STATUSES.index(plan.status if plan else None),
        len(arrays),
    )
    # Before Python 3.12 a type checker does not know that arrays are buffers.
    return b"".join([head, shapes, *arrays, message])  # pyright: ignore[reportArgumentType]


def read_header(file: BinaryIO, path: str | Path) -> dict[str, Any]:
    """Return what the first line says.

    Raises:
        ProblemError: if it is none of a flight record.
    """
    try:
        said = json.loads(file.readline())
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ProblemError(f"{path} is no flight record") from error
    if not isinstance(said, dict) or said.get("format") != _FORMAT:
        raise ProblemError(f"{path} is no {_FORMAT}")
    return said


def records(path: str | Path) -> Iterator[Record]:
    """Yield the complete records of a file, in order.

    Raises:
        ProblemError: if it is no flight record.
    """
    with opened(path, "rb", "flight record") as file:
        names = read_header(file, path)["parameters"]
        while (head := file.read(_HEAD.size)) and len(head) == _HEAD.size:
            body = file.read(_HEAD.unpack(head)[0])
            if len(body) < _HEAD.unpack(head)[0]:
                return
            yield _unpacked(head, body, names)


def _unpacked(head: bytes, body: bytes, names: Sequence[str]) -> Record:
    (_, t, residual, clipped, time_used, age, source, status, late, informed, kind, made, count
     ) = _HEAD.unpack(head)  # fmt: skip
    arrays, end = _arrays(body, count)
    rest = iter(arrays)
    measured = next(rest)
    sent = next(rest) if source else None
    plan = None
    if kind:
        own = [next(rest) for _ in _ARRAYS]
        plan = Plan(_KINDS[kind], _STATUSES[made], *own)  # pyright: ignore[reportArgumentType]
    return Record(
        t=t,
        source=_SOURCES[source],
        status=_STATUSES[status],
        message=body[end:].decode(),
        measured=measured,
        input=sent,
        parameters=dict(zip(names, rest, strict=bool(informed))),
        plan=plan,
        late=bool(late),
        parameters_known=bool(informed),
        residual=residual,
        clipped=clipped,
        age=age,
        time_used=time_used,
    )


def _arrays(body: bytes, count: int) -> tuple[list[np.ndarray], int]:
    """Return the arrays at the beginning, and where they end."""
    at, found = count * _SHAPE.size, []
    for rows, columns in _SHAPE.iter_unpack(body[:at]):
        shape = (rows,) if columns == _VECTOR else (rows, columns)
        size = int(np.prod(shape))
        found.append(np.frombuffer(body, count=size, offset=at).reshape(shape))
        at += 8 * size
    return found, at
