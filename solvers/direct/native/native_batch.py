"""``NativeBatch``: many solves of one problem in C, on several threads, without Python a solve."""

import ctypes
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from functools import cached_property
from queue import Empty, SimpleQueue

import numpy as np

from ocp import OCP
from ocp.internal import RunData, Transcription, interruptible
from solvers.direct.first_trajectory import explodes
from solvers.direct.native.flat_rows import FlatRows
from solvers.direct.native.native_library import NativeLibrary, NativeOptions, NativeReport
from solvers.direct.native.native_solve import ENDINGS, NativeSolve
from solvers.direct.nlp_verdict import NOT_STATIONARY, VIOLATED

_SOLVED = ENDINGS.index("solved")
_REPORT = len(NativeReport._fields)
# Numbers that the library writes of every solve, see ``batch.h``.
_MADE = _REPORT + 3
# How many solves a thread takes at once, a multiple of the lanes.
_SHARE = 16
# After so long the thread that waits for the others looks whether they are to stop [s].
_LOOK = 0.1
# A start may violate a row by so much, as ``start_violation`` has it.
_STARTS = 1e-6


class _Pointers(ctypes.Structure):
    """``Batch`` of ``batch.h``."""

    _fields_ = (
        ("x", ctypes.c_void_p),
        ("u", ctypes.c_void_p),
        ("costate", ctypes.c_void_p),
        ("data", ctypes.c_void_p),
        ("own_data", ctypes.c_void_p),
        ("has_states", ctypes.c_void_p),
        ("warm", ctypes.c_void_p),
        ("made", ctypes.c_void_p),
        ("stop", ctypes.c_void_p),
    )


@dataclass(frozen=True, eq=False)
class NativeSolves:
    """K solves of one problem: first iterates, and then answers in their place.

    Attributes:
        x: states, (K, N + 1, nx), with the start at node 0; a free final time is the last one.
        u: controls within their bounds, (K, N, nu).
        costate: (K, N + 1, nx).
        has_states: whether x is a first iterate, bool (K,); else the controls are rolled out.
        is_warm: whether the costates are a guess of value, bool (K,).
        data: of the nodes, (K, N + 1, nd), or (1, N + 1, nd) for all.
    """

    x: np.ndarray
    u: np.ndarray
    costate: np.ndarray
    has_states: np.ndarray
    is_warm: np.ndarray
    data: np.ndarray

    @property
    def count(self) -> int:
        """K."""
        return len(self.x)

    @cached_property
    def made(self) -> np.ndarray:
        """What the library writes of every solve, (K, numbers); NaN: not begun."""
        return np.full((self.count, _MADE), np.nan)

    @property
    def endings(self) -> np.ndarray:
        """How each has ended, an index of ``ENDINGS`` or ``PAUSED``; NaN: not begun."""
        return self.made[:, _REPORT]

    @property
    def done(self) -> np.ndarray:
        """Which have come to an end, bool (K,)."""
        return self.endings < len(ENDINGS)

    def reported(self, name: str) -> np.ndarray:
        """Return a number of ``NativeReport`` of every solve, (K,)."""
        return self.made[:, NativeReport._fields.index(name)]


@dataclass(frozen=True, eq=False)
class NativeBatch:
    """Many solves of one problem whose start is given.

    Attributes:
        solver: the native solver of the problem.
        accuracy: the largest accepted error of a state, see ``NlpVerdict``.
    """

    solver: NativeSolve
    accuracy: float

    @property
    def transcription(self) -> Transcription:
        """The problem on its grid."""
        return self.solver.library.code.transcription

    def data(self, runs: list[RunData]) -> np.ndarray:
        """Return the data of the nodes for runs, (len(runs), N + 1, nd)."""
        code, tr = self.solver.library.code, self.transcription
        return np.array([code.data(tr.data_vector(run)) for run in runs])

    def solve(self, many: NativeSolves, threads: int, watch: Callable[[int], bool]) -> None:
        """Solve them all; what does not end as solved keeps its first iterate.

        Args:
            many: the solves, which answers are written to.
            threads: how many work; the answers are the same for any number.
            watch: is told now and then how many are done, by the calling thread, and returns
                whether to stop. Where it raises, as Ctrl-C does, the solves stop too.
        """
        work = _Work.of(self, many)
        if watch(0):
            return
        with ThreadPoolExecutor(threads) as pool:
            try:
                running = [pool.submit(work.until_done) for _ in range(threads)]
                pending = set(running)
                while pending:
                    _, pending = wait(pending, timeout=_LOOK)
                    if watch(int(np.count_nonzero(many.done))):
                        work.stop.value = 1
            finally:
                work.stop.value = 1
        for each in running:
            each.result()

    @interruptible
    def clean(self, many: NativeSolves, t0: float) -> np.ndarray:
        """Return which answers need nothing else, bool (K,): as ``WarmRun`` accepts its own."""
        bound = NOT_STATIONARY * (1.0 + many.reported("multiplier"))
        moved, unmoved = many.made[:, _REPORT + 1], many.made[:, _REPORT + 2]
        is_accurate = self._ocp.model.is_discrete | (moved <= self.accuracy)
        is_right = (many.reported("dual") <= bound) & (many.reported("primal") <= VIOLATED)
        is_solved = (many.endings == _SOLVED) & np.isfinite(many.reported("cost"))
        return is_solved & is_right & is_accurate & (unmoved == 0.0) & self._may_start(many, t0)

    def _may_start(self, many: NativeSolves, t0: float) -> np.ndarray:
        """Return which starts meet what they alone decide, see ``start_violation``."""
        ocp, x0 = self._ocp, many.x[:, 0, : self._ocp.model.nx]
        excess = ocp.state_bounds.excess(x0).max(axis=1)
        if ocp.rows.path and ocp.decided_by_start.any():
            n_p = ocp.p.numel()
            p = np.broadcast_to(many.data[:, 0, 3 : 3 + n_p], (many.count, n_p))
            u = ocp.control_bounds.clip(np.zeros((many.count, ocp.model.nu)))
            rows = ocp.functions.path.map(many.count)(x0.T, u.T, t0, p.T)
            of_rows = ocp.rows.path.excess(np.array(rows).T)
            of_rows[:, ~ocp.decided_by_start] = 0.0
            excess = np.maximum(excess, of_rows.max(axis=1))
        return excess <= _STARTS

    @property
    def _ocp(self) -> OCP:
        return self.transcription.ocp


@dataclass(frozen=True, eq=False)
class _Work:
    """What is left to do, shared by the threads.

    Attributes:
        batch: what is solved.
        many: the solves.
        flags: own data, known states and warm starts as whole numbers of C.
        bounds: of every run.
        rows: where they stand.
        shares: where each share begins.
        stop: not 0: no more.
    """

    batch: NativeBatch
    many: NativeSolves
    flags: tuple[np.ndarray, ...]
    bounds: dict[str, np.ndarray]
    rows: FlatRows
    shares: "SimpleQueue[int]"
    stop: ctypes.c_int

    @classmethod
    def of(cls, batch: NativeBatch, many: NativeSolves) -> "_Work":
        """Return the whole work."""
        own = np.array([len(many.data) > 1])
        flags = tuple(a.astype(np.intc) for a in (own, many.has_states, many.is_warm))
        shares: SimpleQueue[int] = SimpleQueue()
        for first in range(0, many.count, _SHARE):
            shares.put(first)
        tr = batch.transcription
        bounds, rows = tr.bounds(RunData.of(tr.ocp)), FlatRows.of(batch.solver.library.code)
        return cls(batch, many, flags, bounds, rows, shares, ctypes.c_int(0))

    def until_done(self) -> None:
        """Take shares until there is none, with a memory of this thread."""
        library, pointers = self._library(), self._pointers()
        solver = self.batch.solver
        options = (NativeOptions * 2)(solver.cold_options, solver.warm_options)
        while not self.stop.value:
            try:
                first = self.shares.get_nowait()
            except Empty:
                return
            end = min(first + _SHARE, self.many.count)
            self._first_states(library, pointers, first, end)
            library.solve_many(pointers, options, first, end)

    def _library(self) -> NativeLibrary:
        """Return the library with memory of its own."""
        library = replace(self.batch.solver.library)
        library.arrays.sizes[:] = library.code.sizes
        self.rows.put_bounds(library.arrays, self.bounds)
        library.read_bounds()
        return library

    def _pointers(self) -> _Pointers:
        many = self.many
        arrays = (many.x, many.u, many.costate, many.data, *self.flags, many.made)
        pointers = [array.ctypes.data for array in arrays]
        return _Pointers(*pointers, ctypes.addressof(self.stop))

    def _first_states(
        self, library: NativeLibrary, pointers: _Pointers, first: int, end: int
    ) -> None:
        """Roll controls out where states are not known; hold the start where that explodes."""
        many, ocp = self.many, self.batch.transcription.ocp
        missing = first + np.flatnonzero(~many.has_states[first:end])
        if not missing.size:
            return
        library.roll_out(pointers, first, end)
        x = many.x[missing, :, : ocp.model.nx]
        with np.errstate(invalid="ignore", over="ignore"):
            is_wild = explodes(x, ocp.state_bounds) | ~np.isfinite(x).all(axis=(1, 2))
        wild = missing[is_wild]
        many.x[wild] = many.x[wild, :1]
