"""From an approximate solution of a quadratic program to an exact one."""

from typing import NamedTuple

import numpy as np

from solvers.linear.qp.multiplier_space import MultiplierSpace
from solvers.linear.qp.quadratic_program import QP, Residuals, residuals
from solvers.linear.regular_matrix import LAPACK

# How often all wrong rows are exchanged at once before they are exchanged one by one.
_BLOCK_STEPS = 8
# Relative to what has to cancel, violations and multipliers below this are rounding.
_ROUNDING = 1e-12
# What has residuals like these is not compared with the guess.
_EXACT = 1e-10
# A row is dependent on the met ones if less than this part of its curvature is left.
_DEPENDENT = 1e-11


class ActiveSetResult(NamedTuple):
    """The best point, its multipliers and residuals, and how many systems it took."""

    z: np.ndarray
    y: np.ndarray
    residuals: Residuals
    systems: int


class ActiveSet:
    """Find the active rows of a program from a guess, and its solution to rounding with them.

    First all wrong rows are exchanged at once: those with a multiplier of the wrong sign leave,
    those that are violated enter. This is Newton's method [Hintermueller, Ito & Kunisch 2002],
    and takes few steps from a good guess, but it can cycle: along a bound of a state that is
    sampled finely, rows enter and leave together for ever. Then rows are exchanged one by one
    [Goldfarb & Idnani 1983], which cannot cycle since the dual cost rises with every row that
    enters, and which proves infeasibility where no step ends.
    """

    def __init__(self) -> None:
        """Wait for a program."""
        self._space: MultiplierSpace | None = None
        self._of: QP | None = None

    def refine(self, qp: QP, z: np.ndarray, y: np.ndarray) -> ActiveSetResult:
        """Return the better one of (z, y) and the optimum that its active rows lead to.

        Args:
            qp: the program.
            z: an approximate solution (n,).
            y: its multipliers (rows,).
        """
        space, systems = self._prepared(qp), 0
        if space is not None:
            rows = qp.products.G @ z
            side = (qp.u - rows < y).astype(int) - (rows - qp.l < -y)
            side[space.equal] = 0
            search = _Search(qp, space, side)
            solved = search.exchange_all() or search.exchange_single()
            found = space.optimum(qp, search.met, search.limits()) if solved else None
            systems = search.systems + 1
            if found is not None:
                remain = residuals(qp, *found)
                if max(remain) <= _EXACT:
                    return ActiveSetResult(*found, remain, systems)
                z, y = min((found, (z, y)), key=lambda point: max(residuals(qp, *point)))
        return ActiveSetResult(z, y, residuals(qp, z, y), systems)

    def _prepared(self, qp: QP) -> MultiplierSpace | None:
        """Return the program's space; that of the last one if only vectors have changed."""
        last, space = self._of, self._space
        same = last is not None and last.H is qp.H and last.G is qp.G
        if not (same and space is not None and np.array_equal(space.equal, qp.l == qp.u)):
            try:
                self._space = MultiplierSpace(qp)
            except np.linalg.LinAlgError:
                self._space = None
            self._of = qp
        return self._space


class _Search:
    """One search for the active rows.

    Attributes:
        side: of each row: 1 met at its upper bound, -1 at its lower one, 0 not met.
        met: indices of the rows that are met.
        systems: number of systems solved.
    """

    def __init__(self, qp: QP, space: MultiplierSpace, side: np.ndarray) -> None:
        self._qp, self._space, self.side, self.systems = qp, space, side, 0
        self.met = np.flatnonzero(side)
        self._start = space.free(qp)
        self._n = len(qp.g)
        self._rows = qp.products.G @ self._start[: self._n]
        self._rounding = _ROUNDING * (1.0 + np.abs(self._rows).max(initial=0.0))

    def limits(self) -> np.ndarray:
        """Return what each met row is equal to."""
        met = self.met
        return np.where(self.side[met] > 0, self._qp.u[met], self._qp.l[met])

    def put(self, rows: np.ndarray | int, side: np.ndarray | int) -> None:
        """Say at which bound rows are met, or with 0 that they are not."""
        self.side[rows] = side
        self.met = np.flatnonzero(self.side)

    def exchange_all(self) -> bool:
        """Exchange all wrong rows at once; return whether that ended at the solution."""
        seen: set[bytes] = set()
        for _ in range(_BLOCK_STEPS):
            y = self._multipliers()
            if y is None:
                return False
            excess = self._excess(y)
            wrong = self.met[self._wrong(y)]
            enters = np.flatnonzero(np.abs(excess) > self._rounding)
            if not (wrong.size or enters.size):
                return True
            self.side[wrong] = 0
            self.put(enters, np.sign(excess[enters]).astype(int))
            key = self.side.tobytes()
            if key in seen:
                return False
            seen.add(key)
        return False

    def exchange_single(self) -> bool:
        """Exchange one row at a time; False if there is no solution (or rounding hides it)."""
        y = self._shrink()
        for _ in range(4 * len(self.side)):
            excess = self._excess(y)
            row = int(np.abs(excess).argmax())
            if np.abs(excess[row]) <= self._rounding:
                return True
            entered = self._enter(row, float(excess[row]), y)
            if entered is None:
                return False
            y = entered
        return False

    # -- pieces -----------------------------------------------------------------------------

    def _multipliers(self) -> np.ndarray | None:
        """Return the multipliers of the met rows; None if these are dependent."""
        self.systems += 1
        met = self.met
        if not met.size:
            return np.empty(0)
        _, y, failed = LAPACK.dposv(self._space.gram(met), self._rows[met] - self.limits())
        return None if failed else y

    def _excess(self, y: np.ndarray) -> np.ndarray:
        """Return by how much each row that is not met exceeds its bounds, negative below."""
        qp, z = self._qp, (self._start - self._space.displacement(self.met, y))[: self._n]
        rows = qp.products.G @ z
        excess = np.maximum(rows - qp.u, 0.0) + np.minimum(rows - qp.l, 0.0)
        excess[self.met] = 0.0
        excess[self._space.equal] = 0.0
        return excess

    def _wrong(self, y: np.ndarray) -> np.ndarray:
        """Return which multipliers of met rows have the wrong sign."""
        return y * self.side[self.met] < -_ROUNDING * np.abs(y).max(initial=0.0)

    def _shrink(self) -> np.ndarray:
        """Leave rows until no multiplier has the wrong sign, and return the multipliers."""
        while self.met.size:
            y = self._multipliers()
            wrong = np.ones(self.met.size, dtype=bool) if y is None else self._wrong(y)
            if y is not None and not wrong.any():
                return y
            self.put(self.met[wrong], 0)
        return np.empty(0)

    def _enter(self, row: int, excess: float, y: np.ndarray) -> np.ndarray | None:
        """Raise the multiplier of a row until the row is met; rows in the way leave.

        Returns:
            the multipliers of all rows then met; None if the row cannot be met.
        """
        sign, own = np.sign(excess), 0.0
        while True:
            self.systems += 1
            met = self.met
            gram = self._space.gram(np.append(met, row))
            slope = LAPACK.dposv(gram[:-1, :-1], gram[:-1, -1])[1] if met.size else np.empty(0)
            curvature = gram[-1, -1] - gram[-1, :-1] @ slope
            # Multipliers change by -slope * t, the row's excess by -curvature * t.
            falling = sign * slope * self.side[met] > 0.0
            with np.errstate(divide="ignore", invalid="ignore"):
                until = np.where(falling, np.maximum(y / (sign * slope), 0.0), np.inf)
            blocking = int(until.argmin()) if met.size else -1
            first = until[blocking] if met.size else np.inf
            dependent = curvature <= _DEPENDENT * gram[-1, -1]
            full = np.inf if dependent else abs(excess) / curvature
            length = min(first, full)
            if not np.isfinite(length):
                return None
            y = y - sign * slope * length
            own += sign * length
            excess -= sign * curvature * length
            if full <= first:
                self.put(row, int(sign))
                return np.insert(y, int(np.searchsorted(met, row)), own)
            self.put(met[blocking], 0)
            y = np.delete(y, blocking)
