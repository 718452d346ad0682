"""The compiled native solver in this process, and its memory as arrays."""

import ctypes
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ocp import Compiler
from ocp.internal import Unbuildable, built_library
from solvers.direct.native.library_check import first_difference
from solvers.direct.native.native_arrays import NativeArrays
from solvers.direct.native.stage_code import NOTED, StageCode

_LINE = 64  # bytes that memory is aligned to
_REPORT = 13  # numbers of ``native_report``
_PAUSED = 6  # of ``Ending``
#: What is noted of an iteration.
NOTE = ("cost", "primal", "dual", "product", "barrier", "shift", "length")


class NativeReport(NamedTuple):
    """What a solve has come to, by its own account.

    Attributes:
        cost: at the iterate.
        dual: largest entry of the Lagrangian's gradient.
        primal: largest gap or violation, slacks included.
        product: largest slack times multiplier.
        multiplier: the largest.
        iterations: steps that were accepted.
        factorisations: of the condensed system.
        evaluations: of all derivatives.
        values: evaluations of values alone.
        is_monotone: whether the barrier parameter has become so.
        shift: of the last Hessian.
        barrier: the last barrier parameter.
        seconds: of the solve, by the clock of the library [s].
    """

    cost: float
    dual: float
    primal: float
    product: float
    multiplier: float
    iterations: float
    factorisations: float
    evaluations: float
    values: float
    is_monotone: float
    shift: float
    barrier: float
    seconds: float


class NativeAccount(ctypes.Structure):
    """``Account`` of ``account.h``: what an answer is worth, beside its optimality.

    Attributes:
        moved: by how much half the integration step moves a state, relative to size + abs(x).
        node: where.
        unmoved: number of controls that are those of the first iterate all along.
    """

    moved: float
    node: float
    unmoved: float
    _fields_ = (
        ("moved", ctypes.c_double),
        ("node", ctypes.c_double),
        ("unmoved", ctypes.c_double),
    )


class NativeOptions(ctypes.Structure):
    """``Options`` of ``workspace.h``."""

    _fields_ = (
        ("tolerance", ctypes.c_double),
        ("barrier", ctypes.c_double),
        ("max_iterations", ctypes.c_double),
        ("time_limit", ctypes.c_double),
        ("pause", ctypes.c_double),
        ("warm", ctypes.c_double),
        ("monotone", ctypes.c_double),
        ("frozen", ctypes.c_double),
    )


@dataclass(frozen=True, eq=False)
class NativeLibrary:
    """The native solver of one problem, with memory for one solve at a time.

    Attributes:
        code: what was compiled.
        library: the machine code.
    """

    code: StageCode
    library: ctypes.CDLL

    @classmethod
    def of(cls, code: StageCode, compiler: Compiler | None = None) -> "NativeLibrary":
        """Compile and load it, or load it from the cache.

        Raises:
            Unbuildable: where there is no compiler, it fails, or what it has made cannot be loaded
                or gives other numbers than CasADi.
            UnsupportedProblem: for an operation that cannot be written as C.
        """
        name, path = code.transcription.ocp.name, built_library(code.code, compiler or Compiler())
        try:
            library = ctypes.CDLL(str(path))
        except OSError as reason:
            raise Unbuildable(
                f"{name}: the library of the native backend cannot be loaded: {reason}"
            ) from reason
        library.native_bytes.restype = ctypes.c_size_t
        library.native_evaluate.restype = ctypes.c_double
        library.native_evaluate.argtypes = [ctypes.c_void_p, ctypes.c_int]
        library.native_linear_step.argtypes = [ctypes.c_void_p, ctypes.c_double]
        library.native_shift.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double]
        loaded = cls(code, library)
        if wrong := first_difference(code, loaded.arrays, loaded.evaluate, loaded.account):
            raise Unbuildable(
                f"{name}: the compiled stage gives other numbers than CasADi ({wrong}): the "
                "compiler is at fault"
            )
        loaded._clear()
        return loaded

    def _clear(self) -> None:
        """Lay the memory out again."""
        self.library.native_set_up(self._block, self.code.transcription.n)
        self.arrays.sizes[:] = self.code.sizes

    def shift(self, t0: float, duration: float) -> None:
        """Write the plan in ``plan_t``, ..., moved to begin at t0 [s], into the iterate."""
        self.library.native_shift(self._block, t0, duration)

    def begin(self) -> None:
        """Move the iterate into its bounds, and keep it for ``account``."""
        self.library.native_begin(self._block)

    def account(self) -> NativeAccount:
        """Move the answer into its bounds, with the costate of a given start; say its worth."""
        account = NativeAccount()
        self.library.native_account(self._block, ctypes.byref(account))
        return account

    def freeze(self) -> None:
        """Freeze the program at the answer of the last solve, see ``frozen.h``."""
        self.library.native_freeze(self._block)

    def judge(self) -> None:
        """Let ``report`` say what a frozen program's answer is worth in the problem itself."""
        self.library.native_judge(self._block)

    def solve(self, options: NativeOptions) -> int:
        """Solve from what is in the arrays; return how it ended, an ``Ending``.

        Between pauses Python handles its signals, so that Ctrl-C ends it.
        """
        ending, begin = _PAUSED, 1
        while ending == _PAUSED:
            ending = self.library.native_solve(self._block, ctypes.byref(options), begin)
            begin = 0
        return ending

    def roll_out(self, batch: ctypes.Structure, first: int, end: int) -> None:
        """Integrate the controls of some solves of a batch, see ``batch.h``."""
        self.library.native_roll_out(self._block, ctypes.byref(batch), first, end)

    def solve_many(
        self,
        batch: ctypes.Structure,
        options: "ctypes.Array[NativeOptions]",
        first: int,
        end: int,
    ) -> None:
        """Solve some of a batch, cold or warm with the options of either, see ``batch.h``."""
        self.library.native_solve_many(self._block, ctypes.byref(batch), options, first, end)

    def read_bounds(self) -> None:
        """Take over what is in ``low``, ``up``, ``x_given`` and ``u_given``."""
        self.library.native_read_bounds(self._block)

    def report(self) -> NativeReport:
        """Return what the last solve has come to."""
        self.library.native_report(self._block, self._numbers)
        return NativeReport(*self._numbers)

    def notes(self) -> np.ndarray:
        """Return what is noted of the iterations, one row each, in the order of ``Note``."""
        memory, notes = self._notes
        return notes[: self.library.native_notes(self._block, memory)].copy()

    def lagrangian_gradient(self) -> np.ndarray:
        """Return what multipliers of given unknowns balance, (N + 1, nu + nx) in (u, x)."""
        self.library.native_gradient(self._block)
        return self.arrays.rhs

    def linear_step(self, shift: float) -> bool:
        """Solve the condensed system of what is in the arrays; return whether it is convex."""
        return bool(self.library.native_linear_step(self._block, shift))

    def evaluate(self, order: int) -> float:
        """Evaluate at what is in the arrays, up to derivatives of an order; return the cost."""
        return float(self.library.native_evaluate(self._block, order))

    @cached_property
    def bytes(self) -> int:
        """Length of its memory."""
        return int(self.library.native_bytes(self.code.transcription.n))

    @cached_property
    def _memory(self) -> np.ndarray:
        return np.zeros(self.bytes + _LINE, dtype=np.uint8)

    @cached_property
    def _numbers(self) -> "ctypes.Array[ctypes.c_double]":
        """Where a report is written."""
        return (ctypes.c_double * _REPORT)()

    @cached_property
    def _notes(self) -> tuple[ctypes.c_void_p, np.ndarray]:
        """Where notes are written, and as an array."""
        notes = np.empty((NOTED, len(NOTE)))
        return ctypes.c_void_p(notes.ctypes.data), notes

    @cached_property
    def _block(self) -> ctypes.c_void_p:
        """The memory, laid out."""
        address = self._memory.ctypes.data
        block = ctypes.c_void_p(address + -address % _LINE)
        self.library.native_set_up(block, self.code.transcription.n)
        return block

    @cached_property
    def arrays(self) -> NativeArrays:
        """The arrays in the memory."""
        code, m = self.code, self.code.transcription.n + 1
        nx, nu, rows = code.nx, code.nu, code.flat_size
        nw, total = nx + nu, code.row_total
        states, controls, nodes = (m, nx), (m - 1, nu), (m, nw)
        shapes = {name: (rows,) for name in NativeArrays._fields}
        states_of = ("x", "costate", "dx", "dcostate", "plan_x", "plan_costate")
        shapes |= dict.fromkeys(states_of, states)
        shapes |= dict.fromkeys(("u", "u_given", "du", "plan_u"), controls)
        shapes |= dict.fromkeys(("gradient", "rhs"), nodes)
        shapes |= {"data": (m, code.nd), "x_given": (nx,), "gap": (m - 1, nx)}
        shapes |= {"sizes": (nx,), "plan_t": (m,), "half_step": (m - 1, nx)}
        shapes |= {"slope": (m - 1, nx, nw), "hessian": (m, nw, nw), "c_slope": (total, nw)}
        pointers = (ctypes.POINTER(ctypes.c_double) * len(shapes))()
        self.library.native_arrays(self._block, pointers)
        return NativeArrays(*map(_view, pointers, shapes.values()))


def _view(pointer: "ctypes._Pointer[ctypes.c_double]", shape: tuple[int, ...]) -> np.ndarray:
    """Return memory as an array; it lives as long as the library that owns it."""
    size = int(np.prod(shape))
    if not size:
        return np.zeros(shape)
    return np.ctypeslib.as_array(pointer, (size,)).reshape(shape)
