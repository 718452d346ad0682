"""Things that fail on a schedule: a solver, a sensor, a computer that is too slow."""

from dataclasses import dataclass, field
from typing import NamedTuple, cast

import numpy as np

from ocp import MPC, Decision, Solution, Status

# What happens inside the solver, or to its answer.
IN_SOLVER = (
    "exception", "driver error", "no convergence", "iteration limit", "nan answer",
    "out of bounds", "no answer", "foreign answer",
)  # fmt: skip
# What the controller is told.
IN_SENSOR = ("nan measurement", "absurd measurement", "jumped measurement", "outlier")
# What it is asked for, or meets.
OUTSIDE = ("late answer", "no parameters", "infeasible target", "obstacle", "mismatch")
KINDS = (*IN_SOLVER, *IN_SENSOR, *OUTSIDE)
# No decision may be called optimal while one of these lasts.
NEVER_OPTIMAL = frozenset(
    {*IN_SOLVER, "nan measurement", "absurd measurement", "late answer", "no parameters"}
)
# The largest number of single precision, which marks a sample that is none.
_ABSURD, _OUTLIER = 3.4028235e38, 1e5
_CALM, _LENGTH = (15, 30), (1, 8)  # steps


class Fault(NamedTuple):
    """A fault that lasts for some steps.

    Attributes:
        kind: of ``KINDS``.
        first: step.
        last: step, included.
        size: in [-1, 1], how bad it is, where that can be said.
    """

    kind: str
    first: int
    last: int
    size: float


Schedule = tuple[Fault, ...]


def schedule(steps: int, seed: int) -> Schedule:
    """Return faults one after the other, each kind as often as any, calm steps in between."""
    rng = np.random.default_rng(seed)
    faults, at, kinds = [], 0, []
    while True:
        kinds = kinds or [str(kind) for kind in rng.permutation(KINDS)]
        first = at + int(rng.integers(*_CALM, endpoint=True))
        at = first + int(rng.integers(*_LENGTH, endpoint=True))
        if at >= steps:
            return tuple(faults)
        faults.append(Fault(kinds.pop(), first, at - 1, float(rng.uniform(-1.0, 1.0))))


def active(faults: Schedule, t: float, dt: float) -> Fault | None:
    """Return the fault at an instant [s]."""
    k = round(t / dt)
    return next((fault for fault in faults if fault.first <= k <= fault.last), None)


class DriverError(Exception):
    """What somebody else's code raises, of no kind that anybody expects."""


@dataclass(frozen=True)
class Spoiled:
    """What a schedule makes of a good solver's answers; for ``Altered``.

    Args:
        dt: sampling interval of the loop [s].
        faults: only those of ``IN_SOLVER`` matter here.
    """

    dt: float
    faults: Schedule

    def __call__(self, solution: Solution, t0: float) -> Solution:
        """Spoil an answer if it is time, or raise."""
        fault = active(self.faults, t0, self.dt)
        return _spoilt(solution, fault) if fault else solution


def _spoilt(solution: Solution, fault: Fault) -> Solution:
    said = f"on schedule: {fault.kind}"
    match fault.kind:
        case "exception":
            raise RuntimeError(said)
        case "driver error":
            raise DriverError(said)
        case "no answer":
            return cast(Solution, None)
        case "foreign answer":
            return solution.with_(t=solution.t + 10.0)
        case "no convergence":
            return solution.with_(status=Status.DIVERGED, message=said)
        case "iteration limit":
            u = (1.0 + 0.5 * fault.size) * solution.u
            return solution.with_(u=u, status=Status.ITERATION_LIMIT, message=said)
        case "nan answer":
            return solution.with_(u=np.full_like(solution.u, np.nan))
        case "out of bounds":
            # Next to a singular posture the null space hardly moves the joints.
            return solution.with_(u=solution.u + np.copysign(1e9, fault.size))
    return solution


@dataclass(frozen=True, eq=False)
class Hindered:
    """An ``MPC`` whose answers come too late on a schedule, rather than by the clock.

    Attributes:
        mpc: the controller.
        faults: the schedule.
    """

    mpc: MPC
    faults: Schedule = field(default=())

    @property
    def delay(self) -> float:
        """Of the MPC [s]."""
        return self.mpc.delay

    def reset(self, acting: np.ndarray | None = None) -> None:
        """Reset the MPC."""
        self.mpc.reset(acting)

    def step(self, x: np.ndarray, t: float) -> Decision:
        """Decide, late or not."""
        fault = active(self.faults, t, self.mpc.dt)
        return self.mpc.step(x, t, late=fault is not None and fault.kind == "late answer")

    def sensors(self, x: np.ndarray, t: float) -> np.ndarray:
        """Return what the controller is told of a measurement."""
        fault = active(self.faults, t, self.mpc.dt)
        if fault is None or fault.kind not in IN_SENSOR:
            return x
        match fault.kind:
            case "nan measurement":
                return np.append(np.nan, x[1:])
            case "absurd measurement":
                return np.full(len(x), np.copysign(_ABSURD, fault.size))
            case "outlier":
                return x + _OUTLIER * fault.size
            case _:
                return x + 2.0 * fault.size
