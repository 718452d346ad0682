"""Constrained linear optimal control: one quadratic program, solved again and again."""

from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
import scipy.sparse as sp

from ocp import OCP, InitialGuess, Program, Status, UnsupportedProblem, Work, linear_quadratic
from ocp.internal import (
    BlockingSolver,
    ImposedRows,
    LinearQuadratic,
    LQData,
    Matrices,
    MethodProgram,
    RunData,
    RunResult,
    ScaledOCP,
    check_choice,
    check_flag,
    check_positive,
    elastic,
    scaled,
    start_violation,
)
from solvers.linear import regulator_gains as recursion
from solvers.linear.linear_forms import Condensed, MPCForm, Sparse
from solvers.linear.qp.least_violation import least_violation
from solvers.linear.qp.qp_backends import NEEDS_CURVATURE, QpBackend, QpResult, qp_backend
from solvers.linear.qp.quadratic_program import QP, Softening

# A constraint that no point can meet better than this is infeasible, not inaccurate.
_UNAVOIDABLE = 1e-7
# A matrix whose smallest eigenvalue is this part of the largest is singular but for rounding.
_SINGULAR = 1e-14


@dataclass(frozen=True)
class LinearMPC(BlockingSolver):
    r"""A convex linear-quadratic problem with linear constraints, as a quadratic program.

    .. math:: \min_z \; \frac12 z'Hz + g'z \quad \text{s.t.} \quad l \le Gz \le u

    Source: thesis (2.82) to (2.91), with the slips mended: H is twice that of (2.8), and the
    measured state x_0 is not constrained. What a receding-horizon controller calls: between
    runs only the vectors change, the factorisation stays, the last answer is the warm start.
    References are previewed: they are signals of the problem.

    An answer is judged by the residuals computed here, not by the backend's word: ``SOLVED``
    when primal, dual and gap residual are within the tolerance, all relative.

    Stability needs a terminal cost from the algebraic Riccati equation
    (``ocp.with_stationary_end``) and a horizon at whose end no constraint is active, or the
    terminal set with it (``ocp.with_terminal_set``) [Mayne et al. 2000]; or simply a horizon
    that is long.

    Args:
        backend: ``"osqp"`` [Stellato et al. 2020], or any backend of qpsolvers by its name.
        form: ``"sparse"`` keeps the states as unknowns, effort linear in the horizon;
            ``"condensed"`` has inputs only (2.83), pre-stabilised: good for short horizons.
        tolerance: largest accepted residual.
        soft: weight w of an exact penalty w (e + e^2 / 2) at each step on exceeding a constraint
            that does not limit the input (``Constraint(limits_input=...)``) by e, all in the units
            in which the problem is written; it has to exceed the constraints' multipliers. None:
            hard.
        blocks: see ``MultipleShooting``.

    Attributes:
        soft_in_sizes: whether w is a price in the sizes in which the problem is solved instead,
            the same for every row; see ``least_violating``.
    """

    backend: str = "osqp"
    form: Literal["sparse", "condensed"] = "sparse"
    tolerance: float = 1e-8
    soft: float | None = None
    soft_in_sizes: bool = field(default=False, kw_only=True, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the options."""
        super().__post_init__()
        check_choice(self.form, _FORMS, "LinearMPC: form")
        check_positive(self.tolerance, "LinearMPC: tolerance", below=1.0)
        if self.soft is not None:
            check_positive(self.soft, "LinearMPC: soft")
        check_flag(self.soft_in_sizes, "LinearMPC: soft_in_sizes")

    def imposed(self, ocp: OCP) -> ImposedRows:
        """Return the rows that an answer meets: with a penalty, those that limit the input."""
        return ImposedRows(ocp.rows if self.soft is None else ocp.rows.softened())

    def least_violating(self, ocp: OCP) -> Program | None:
        """Build the program with soft rows; None where they are soft already, or there are none."""
        relaxed = elastic(scaled(ocp) or ocp)  # it is solved in these sizes
        if relaxed is None or self.soft is not None:
            return None
        return replace(self.unjudged(), soft=relaxed.penalty, soft_in_sizes=True).build(ocp)

    def prepare(self, ocp: OCP) -> "LinearMPCProgram":
        """Read the matrices, lay the program out."""
        lq = linear_quadratic(ocp)
        form = _FORMS[self.form](lq, self.blocks_on(ocp, lq.steps))
        backend = qp_backend(self.backend, self.tolerance)
        program = LinearMPCProgram(self, ocp, lq, form, backend, self._softening(ocp, form))
        program.prepare(lq.sample_matrices(lq.declared) if lq.fixed is None else lq.fixed)
        if self.backend in NEEDS_CURVATURE and not _is_strictly_convex(form.H):
            raise UnsupportedProblem(
                f"{ocp.name}: {self.backend} needs a positive definite matrix H, which a state "
                f"without a weight makes singular in {self.form} form; take form='condensed' or "
                "another backend"
            )
        return program

    def _softening(self, ocp: OCP, form: MPCForm) -> Softening | None:
        """Return the penalty, whose weight is in the user's units, in those of the program."""
        if self.soft is None:
            return None
        rows = elastic_rows(form)
        units, cost = np.ones(len(rows)), 1.0
        if isinstance(ocp, ScaledOCP) and not self.soft_in_sizes:
            units = np.array([form.places[i - form.equations].unit for i in rows])
            cost = ocp.sizes.cost
        return Softening(rows, self.soft * units / cost, self.soft * units**2 / cost)


def elastic_rows(form: MPCForm) -> np.ndarray:
    """Return the rows that may be relaxed: all but dynamics and limits of the input."""
    rows = [form.equations + i for i, place in enumerate(form.places) if not place.limits_input]
    return np.array(rows, dtype=int)


def _is_strictly_convex(h: sp.csc_matrix) -> bool:
    values = np.linalg.eigvalsh(h.toarray())
    return bool(values[0] > _SINGULAR * values[-1])


_FORMS: dict[str, type[Sparse] | type[Condensed]] = {"sparse": Sparse, "condensed": Condensed}


@dataclass(eq=False)
class _Workspace:
    """What the last run left: its matrices, and the program with them."""

    matrices: Matrices | None = None
    hard: QP | None = None
    soft: QP | None = None


class _Verdict(NamedTuple):
    """What is returned of a quadratic program: point z, multipliers y, and how sound they are."""

    z: np.ndarray
    y: np.ndarray
    status: Status
    message: str


@dataclass(frozen=True, eq=False)
class LinearMPCProgram(MethodProgram):
    """A quadratic program with its backend; one run at a time. A copy starts its backend afresh.

    Attributes:
        lq: the problem as arrays.
        form: layout of unknowns and rows.
        backend: solves it, with its workspace.
        softening: which rows are soft.
    """

    solver: LinearMPC
    lq: LinearQuadratic
    form: MPCForm
    backend: QpBackend
    softening: Softening | None
    _workspace: _Workspace = field(default_factory=_Workspace)

    @property
    def is_stateful(self) -> bool:
        """The backend starts from its last answer."""
        return True

    def prepare(self, matrices: Matrices) -> None:
        """Take other matrices; nothing happens if they are the last ones."""
        w = self._workspace
        if matrices is w.matrices:
            return
        self.form.set_matrices(matrices)
        w.matrices, w.hard = matrices, QP.of(self.form.H, self.form.G)
        w.soft = w.hard
        if self.softening:
            w.soft = QP.of(*self.softening.soften(self.form.H, self.form.G))

    def quadratic_program(self, data: RunData) -> QP:
        """Return the (soft) program of a run, to solve it elsewhere."""
        return self._programs(data.x0, self.lq.on(data))[1]

    def _solve(self, data: RunData, guess: InitialGuess | None) -> RunResult:
        """Solve for these data, from the last answer unless there is a guess."""
        numbers, start = self.lq.on(data), data.x0
        hard, qp = self._programs(start, numbers)
        answer = self.backend.solve(qp, self._warm_start(guess, numbers, qp))
        found = answer.residuals
        z, y, status, message = self._verdict(answer, hard, qp)
        if status is Status.SOLVED and self.softening is None:
            # The program has no row for the start: nothing can be done about it.
            message = start_violation(self.ocp, data)
            status = Status.INFEASIBLE if message else status
        x, u = self.form.trajectory(z, numbers, start)
        half = recursion.half_slopes(numbers, x, u)
        costate = self.form.costates(y, numbers, x[-1], half)
        sound = all(np.isfinite(a).all() for a in (x, u, costate))
        if not sound:
            x, u = np.tile(start, (self.lq.steps + 1, 1)), np.zeros_like(numbers.r)
            costate, status = np.zeros_like(x), Status.DIVERGED
        return RunResult(
            status=status,
            message=message,
            t=data.t0 + self.lq.nodes,
            x=x,
            u=u,
            costate=costate,
            cost=recursion.cost(numbers, x, u, half) if sound else np.inf,
            residual=max(found),
            iterations=answer.iterations,
            work=Work(rollouts=1, factorisations=answer.factorisations),
            history={
                "primal": np.array([found.primal]),
                "dual": np.array([found.dual]),
                "gap": np.array([found.gap]),
                "multipliers": y[self.form.equations :],
            },
        )

    # -- pieces -----------------------------------------------------------------------------

    def _first_guess(self, given: InitialGuess | None) -> InitialGuess | None:
        """Only what is given: the answer of the last run is nearer than the problem's guess."""
        return None if given is None else self.ocp.first_guess(given)

    def _programs(self, start: np.ndarray, numbers: LQData) -> tuple[QP, QP]:
        """Return the program with hard constraints, and the one to solve."""
        self.prepare(numbers.matrices)
        w = self._workspace
        assert w.hard is not None
        assert w.soft is not None
        vectors = self.form.vectors(numbers, start)
        hard = w.hard.with_vectors(*vectors)
        if self.softening is None:
            return hard, hard
        return hard, w.soft.with_vectors(*self.softening.soften_vectors(vectors))

    def _warm_start(self, guess: InitialGuess | None, numbers: LQData, qp: QP) -> np.ndarray | None:
        if guess is None:
            return None
        nodes, model = np.linspace(0.0, 1.0, self.lq.steps + 1), self.lq.ocp.model
        x = guess.sample("x", nodes, model.nx)
        u = guess.sample("u", nodes[:-1], model.nu)
        if x is None or u is None:
            return None
        z = self.form.point(x, u, numbers)
        return np.concatenate([z, np.zeros(len(qp.g) - len(z))])

    def _verdict(self, answer: QpResult, hard: QP, qp: QP) -> _Verdict:
        """Judge an answer by its residuals; without a good one, look for what cannot be met."""
        size, rows, found = len(hard.g), len(hard.l), answer.residuals
        if answer.z is not None and answer.y is not None and max(found) <= self.solver.tolerance:
            y = answer.y if self.softening is None else self.softening.multipliers(answer.y)
            return _Verdict(answer.z[:size], y, Status.SOLVED, self._exceeded(answer.z[size:]))
        elastic = elastic_rows(self.form)
        point, excess = least_violation(qp if self.softening else hard, elastic, rows)
        if excess.max(initial=0.0) > _UNAVOIDABLE:
            worst = int(excess.argmax())
            by = self._in_units(worst, excess[worst])
            said = f"{self._where(worst)} cannot be met, it is exceeded by {by}"
            return _Verdict(point[:size], np.zeros(rows), Status.INFEASIBLE, said)
        said = (
            f"{self.solver.backend} says '{answer.word}'; residuals: primal {found.primal:.2g}, "
            f"dual {found.dual:.2g}, gap {found.gap:.2g}"
        )
        if answer.z is None or answer.y is None:
            return _Verdict(point[:size], np.zeros(rows), Status.FAILED, said)
        y = answer.y if self.softening is None else self.softening.multipliers(answer.y)
        return _Verdict(answer.z[:size], y, Status.ITERATION_LIMIT, said)

    def _where(self, row: int) -> str:
        place = self.form.places[row - self.form.equations]
        dt = self.lq.ocp.model.dt or 0.0
        return f"'{place.name}' at step {place.node} (t0 + {place.node * dt:.4g} s)"

    def _in_units(self, row: int, excess: float) -> str:
        """Return by how much a row is exceeded, in the user's units."""
        return f"{excess * self.form.places[row - self.form.equations].unit:.3g}"

    def _exceeded(self, slack: np.ndarray) -> str:
        """Say which soft constraint is exceeded most."""
        if self.softening is None or slack.max(initial=0.0) <= self.solver.tolerance:
            return ""
        worst = int(slack.argmax())
        row, by = int(self.softening.rows[worst]), float(slack[worst])
        return f"soft constraint {self._where(row)} is exceeded by {self._in_units(row, by)}"
