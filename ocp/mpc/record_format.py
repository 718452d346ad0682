"""One step of a controller as bytes, and back."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from struct import Struct, error, pack
from typing import NamedTuple, get_args

import numpy as np

from ocp.closed_loop.decision import Decision, InputSource, StepReport
from ocp.solution.solution import ControlKind
from ocp.solution.status import Status

# Bytes that follow; t, residual, clipped, time used; age; source, status, late, informed,
# kind and status of the plan, number of arrays.
HEAD = Struct("<I4di7B")
_SHAPE = Struct("<2i")
# Instead of the number of columns: the array has one axis.
_VECTOR = -1


@dataclass(frozen=True)
class Codes:
    """What bytes of a head stand for, by their place; the first entry of each: there is none.

    Attributes:
        sources: names of ``InputSource``.
        statuses: names of ``Status``.
        kinds: of control.
    """

    sources: Sequence[str | None] = (None, *InputSource.__members__)
    statuses: Sequence[str | None] = (None, *Status.__members__)
    kinds: Sequence[ControlKind | None] = (None, *get_args(ControlKind))


CODES = Codes()
_SOURCES = {name: code for code, name in enumerate(CODES.sources)}
_STATUSES = {name: code for code, name in enumerate(CODES.statuses)}
_KINDS = {name: code for code, name in enumerate(CODES.kinds)}


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
    head = HEAD.pack(
        len(shapes) + sum([array.nbytes for array in arrays]) + len(message),
        step.t,
        step.residual,
        decision.clipped if decision else 0.0,
        step.time_used,
        decision.age if decision else 0,
        _SOURCES[decision.source.name if decision else None],
        _STATUSES[step.status.name if step.status else None],
        step.late,
        step.parameters_known,
        _KINDS[plan.control_kind if plan else None],
        _STATUSES[plan.status.name if plan else None],
        len(arrays),
    )
    # Before Python 3.12 a type checker does not know that arrays are buffers.
    return b"".join([head, shapes, *arrays, message])  # pyright: ignore[reportArgumentType]


def size_of(head: bytes) -> int:
    """Return how many bytes of a record follow its first ``HEAD`` bytes."""
    return HEAD.unpack(head)[0]


def unpacked(record: bytes, names: Sequence[str] | None, codes: Codes) -> Record:
    """Return a step from its bytes.

    Args:
        record: as ``packed`` made it.
        names: of the parameters; None: they are called "0", "1", ...
        codes: what its codes stand for.

    Raises:
        ValueError: if these are the bytes of no step.
    """
    try:
        return _unpacked(record, names, codes)
    except (LookupError, TypeError, StopIteration, error) as reason:
        raise ValueError(f"these bytes are no step ({reason!r})") from reason


def _unpacked(record: bytes, names: Sequence[str] | None, codes: Codes) -> Record:
    (follow, t, residual, clipped, time_used, age, source, status, late, informed, kind, made, count
     ) = HEAD.unpack_from(record)  # fmt: skip
    body = record[HEAD.size :]
    if len(body) != follow:
        raise ValueError(f"there are {len(body)} bytes, there should be {follow}")
    arrays, end = _arrays(body, count)
    rest = iter(arrays)
    measured = next(rest)
    sent = next(rest) if source else None
    plan = None
    if kind:
        own = [next(rest) for _ in _ARRAYS]
        plan = Plan(codes.kinds[kind], Status[codes.statuses[made]], *own)  # pyright: ignore[reportArgumentType]
    known = list(rest)
    return Record(
        t=t,
        source=InputSource[codes.sources[source]] if source else None,  # pyright: ignore[reportArgumentType]
        status=Status[codes.statuses[status]] if status else None,  # pyright: ignore[reportArgumentType]
        message=body[end:].decode(),
        measured=measured,
        input=sent,
        parameters=dict(zip(names or map(str, range(len(known))), known, strict=bool(informed))),
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
        if rows < 0 or columns < _VECTOR:
            raise ValueError(f"an array has shape ({rows}, {columns})")
        shape = (rows,) if columns == _VECTOR else (rows, columns)
        size = math.prod(shape)
        found.append(np.frombuffer(body, count=size, offset=at).reshape(shape))
        at += 8 * size
    return found, at
