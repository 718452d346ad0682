"""Backends for quadratic programs: OSQP, kept factorised, or any backend of qpsolvers."""

import pkgutil
import signal
import warnings
from abc import ABC, abstractmethod
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
import osqp
import qpsolvers
import qpsolvers.solvers
import scipy.sparse as sp
from qpsolvers.exceptions import QPError

from ocp import ProblemError
from solvers.linear.qp.active_set import ActiveSet
from solvers.linear.qp.quadratic_program import NO_POINT, QP, Residuals, residuals

# Backends whose method begins with a factorisation of H.
NEEDS_CURVATURE = frozenset({"quadprog"})
# A backend measures its residuals in its own way; it is asked for this much more.
_MARGIN = 0.1
# A matrix with more than this part of its entries not zero is given as a dense one.
_FILLED = 0.2
# OSQP and SCS take over the signal of Ctrl-C while they run, and give it back; so do the filters of
# warnings. Two at once would give back each other's: one at a time, in the whole process.
_ONE_AT_A_TIME = Lock()
# How these two say that Ctrl-C ended them.
_INTERRUPTED = "interrupted"
# What goes wrong inside a backend is its failure, never a sign that it is not installed.
_INSIDE = (QPError, ArithmeticError, LookupError, RuntimeError, ValueError, TypeError)


class QpResult(NamedTuple):
    """What a backend returned.

    Attributes:
        z: (n,), or None.
        y: multipliers of the rows (rows,), or None.
        word: what it says about it.
        iterations: as far as it says.
        factorisations: the same.
        residuals: computed here, not the backend's.
    """

    z: np.ndarray | None
    y: np.ndarray | None
    word: str
    iterations: int = 0
    factorisations: int = 1
    residuals: Residuals = NO_POINT


class QpBackend(ABC):
    """Solves programs whose matrices seldom change."""

    @abstractmethod
    def solve(self, qp: QP, start: np.ndarray | None = None) -> QpResult:
        """Solve a program; the same matrix objects as last time are taken as unchanged."""


class OSQPBackend(QpBackend):
    """OSQP [Stellato et al. 2020], set up once and warm started from its last answer.

    It guesses the active rows to a loose tolerance, ``ActiveSet`` finds them and makes the
    answer exact; only where that fails it goes on, with the same factorisation, to tighter
    ones. Its own polishing is off: it does not correct a wrong guess of the active rows, and it
    prints.
    """

    # Tolerance and iterations of each attempt.
    _LADDER = ((1e-3, 500), (1e-6, 20000), (1e-9, 20000))

    def __init__(self, tolerance: float) -> None:
        """Set nothing up yet."""
        self._tolerance = tolerance
        self._solver: osqp.OSQP | None = None
        self._settings: tuple[float, int] | None = None
        self._refiner = ActiveSet()
        self._h: sp.csc_matrix | None = None
        self._g: sp.csc_matrix | None = None

    def solve(self, qp: QP, start: np.ndarray | None = None) -> QpResult:
        """Update what changed, and solve."""
        factorisations = self._prepare(qp)
        solver = self._solver
        assert solver is not None
        if start is not None:
            solver.warm_start(x=start)
        iterations, word, best = 0, "", None
        for eps, most in self._LADDER:
            self._set(solver, eps, most)
            with _ONE_AT_A_TIME:
                result = solver.solve(raise_error=False)
            iterations, word = iterations + int(result.info.iter), str(result.info.status)
            _pass_on_interrupt(word)
            if "infeasible" in word or not np.isfinite(result.x).all():
                break
            found = self._refiner.refine(qp, result.x, result.y)
            factorisations += found.systems
            if best is None or max(found.residuals) < max(best.residuals):
                best = found
            if max(best.residuals) <= self._tolerance:
                solver.warm_start(x=best.z, y=best.y)
                break
        if best is None:
            self._solver = None  # the iterates of an infeasible program are a bad warm start
            return QpResult(None, None, word, iterations, factorisations)
        return QpResult(best.z, best.y, word, iterations, factorisations, best.residuals)

    def _set(self, solver: osqp.OSQP, eps: float, most: int) -> None:
        """Change tolerance and number of iterations, if they are others."""
        if self._settings != (eps, most):
            solver.update_settings(eps_abs=eps, eps_rel=eps, max_iter=most)
            self._settings = eps, most

    def _prepare(self, qp: QP) -> int:
        """Bring the workspace up to date; return how often it factorised."""
        if self._solver is not None and qp.H is self._h and qp.G is self._g:
            self._solver.update(q=qp.g, l=qp.l, u=qp.u)
            return 0
        upper = sp.csc_matrix(sp.triu(qp.H, format="csc"))
        same = _same_pattern(qp.H, self._h) and _same_pattern(qp.G, self._g)
        if self._solver is not None and same:
            self._solver.update(q=qp.g, l=qp.l, u=qp.u)
            self._solver.update(Px=upper.data, Ax=qp.G.data)
        else:
            self._solver, self._settings = osqp.OSQP(), None
            rows = (qp.G, qp.l, qp.u)
            self._solver.setup(upper, qp.g, *rows, verbose=False, **_OSQP)
        self._h, self._g = qp.H, qp.G
        return 1


class NamedBackend(QpBackend):
    """Any backend of qpsolvers, by its name there; ``ActiveSet`` mends what it leaves inexact."""

    def __init__(self, name: str, tolerance: float) -> None:
        """Keep name and tolerance."""
        self._name, self._tolerance = name, tolerance
        tight = _MARGIN * tolerance
        self._options = dict.fromkeys(_TOLERANCES.get(name, ()), tight) | _MORE.get(name, {})
        self._rows: _SparseRows | None = None
        self._refiner = ActiveSet()

    def solve(self, qp: QP, start: np.ndarray | None = None) -> QpResult:
        """Solve from scratch; rows are sorted only when they have changed."""
        if self._rows is None or not self._rows.fit(qp):
            self._rows = _SparseRows(qp, self._takes_sparse(qp))
        try:
            with _ONE_AT_A_TIME, warnings.catch_warnings():
                warnings.simplefilter("ignore")
                function = qpsolvers.solvers.solve_function[self._name]
                found = function(self._rows.problem(qp), verbose=False, **self._options)
        except _INSIDE as error:
            return QpResult(None, None, f"{type(error).__name__} inside the backend: {error}")
        _pass_on_interrupt(str(found.extras.get("status", "")))
        if found.x is None or not np.isfinite(found.x).all():
            return QpResult(None, None, "no solution found")
        z, y = np.asarray(found.x), self._rows.multipliers(found)
        word, remain = "solved" if found.found else "no solution found", residuals(qp, z, y)
        if max(remain) <= self._tolerance:
            return QpResult(z, y, word, residuals=remain)
        better = self._refiner.refine(qp, z, y)
        return QpResult(better.z, better.y, word, 0, 1 + better.systems, better.residuals)

    def _takes_sparse(self, qp: QP) -> bool:
        """Whether the backend is given sparse matrices: where it can, and they are sparse."""
        if self._name not in qpsolvers.dense_solvers:
            return True
        filled = qp.G.nnz > _FILLED * max(1, len(qp.l) * len(qp.g))
        return self._name in qpsolvers.sparse_solvers and not filled


def _pass_on_interrupt(word: str) -> None:
    """Let Ctrl-C, which a backend has kept to itself, do what it would have done."""
    if word == _INTERRUPTED:
        signal.raise_signal(signal.SIGINT)


class _SparseRows:
    """The rows of a program sorted as qpsolvers takes them: equations, and those below a bound."""

    def __init__(self, qp: QP, sparse: bool) -> None:
        self._h, self._g = qp.H, qp.G
        self._kinds = _kinds(qp)
        self.equal, self.above, self.below = (np.flatnonzero(kind) for kind in self._kinds)
        rows = qp.G.tocsr()
        shape = (lambda a: sp.csc_matrix(a)) if sparse else (lambda a: a.toarray())
        self._cost, self._equations = shape(qp.H), shape(rows[self.equal])
        self._inequalities = shape(sp.vstack([rows[self.above], -rows[self.below]]))

    def fit(self, qp: QP) -> bool:
        """Return whether a program has the same matrices, and bounds at the same rows."""
        same = qp.H is self._h and qp.G is self._g
        return same and np.array_equal(_kinds(qp), self._kinds)

    def problem(self, qp: QP) -> qpsolvers.Problem:
        """Return the program as qpsolvers states it."""
        limits = np.concatenate([qp.u[self.above], -qp.l[self.below]])
        inequalities = (self._inequalities, limits) if limits.size else (None, None)
        equations = (self._equations, qp.u[self.equal]) if self.equal.size else (None, None)
        return qpsolvers.Problem(self._cost, qp.g, *inequalities, *equations)

    def multipliers(self, found: qpsolvers.Solution) -> np.ndarray:
        """Return one multiplier per row of the program."""
        y = np.zeros(self._kinds.shape[1])
        if found.z is not None and len(found.z):
            y[self.above] += found.z[: len(self.above)]
            y[self.below] -= found.z[len(self.above) :]
        if found.y is not None and len(found.y):
            y[self.equal] = found.y
        return y


def _kinds(qp: QP) -> np.ndarray:
    """Which rows are equations, have an upper, have a lower bound, (3, rows)."""
    equal = qp.l == qp.u
    return np.array([equal, np.isfinite(qp.u) & ~equal, np.isfinite(qp.l) & ~equal])


def qp_backend(name: str, tolerance: float) -> QpBackend:
    """Return a backend by its name.

    Raises:
        ProblemError: if the name is unknown, or, with the command to type, if it is not installed.
    """
    known = known_backends()
    if not isinstance(name, str) or name not in known:
        raise ProblemError(f"QP backend {name!r} is not one of {', '.join(known)}")
    if name == "osqp":
        return OSQPBackend(tolerance)
    if name not in qpsolvers.available_solvers:
        raise ProblemError(
            f"QP backend {name!r} is not installed: pip install {_PACKAGES.get(name, name)} "
            f"(installed are {', '.join(sorted(qpsolvers.available_solvers))})"
        )
    return NamedBackend(name, tolerance)


def known_backends() -> tuple[str, ...]:
    """Return the names of all backends that qpsolvers has an interface for."""
    modules = pkgutil.iter_modules(qpsolvers.solvers.__path__)
    return tuple(sorted(m.name[:-1] for m in modules if m.name.endswith("_")))


def _same_pattern(a: sp.csc_matrix, b: sp.csc_matrix | None) -> bool:
    return (
        b is not None
        and np.array_equal(a.indptr, b.indptr)
        and np.array_equal(a.indices, b.indices)
    )


# Where the name of the package is another one.
_PACKAGES = {"highs": "highspy", "proxqp": "proxsuite", "gurobi": "gurobipy"}
# What each backend calls its tolerances.
_TOLERANCES = {
    "clarabel": ("tol_gap_abs", "tol_gap_rel", "tol_feas"),
    "daqp": ("primal_tol", "dual_tol"),
    "ecos": ("feastol", "abstol", "reltol"),
    "highs": ("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
    "piqp": ("eps_abs", "eps_rel", "eps_duality_gap_abs", "eps_duality_gap_rel"),
    "proxqp": ("eps_abs", "eps_rel"),
    "scs": ("eps_abs", "eps_rel"),
}
_MORE: dict[str, dict[str, Any]] = {
    "scs": {"max_iters": 100000},
}
# Infeasibility is decided late, and the answer refined elsewhere.
_OSQP: dict[str, Any] = {
    "check_termination": 10,
    "eps_prim_inf": 1e-7,
    "eps_dual_inf": 1e-7,
}
