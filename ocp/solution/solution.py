"""What a solver returns: a trajectory, its costates, and how it was found."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_instance, check_numeric
from ocp.checks.errors import ProblemError, SolverError
from ocp.checks.rich_text import html_of
from ocp.files.archive import made_of, write_archive
from ocp.normal_form.normal_form import normal_form
from ocp.plotting.plot_method import Plottable
from ocp.plotting.plottable import Pictured
from ocp.problem.data_residuals import data_residuals
from ocp.problem.fingerprint import fingerprint_entries
from ocp.problem.nominal_sizes import Sizes
from ocp.problem.ocp import OCP
from ocp.problem.portable import without_caches
from ocp.problem.run_data import RunData
from ocp.problem.scaled import scaled, sizes_of
from ocp.solution.by_name import (
    excess_of_soft,
    largest_values,
    prices_of_constants,
    prices_of_constraints,
)
from ocp.solution.extremal import Extremal, RewrittenExtremal
from ocp.solution.field_checks import check_fields
from ocp.solution.piecewise_polynomial import PiecewisePolynomial
from ocp.solution.solution_file import content_of, read_fields
from ocp.solution.status import Status
from ocp.solution.work import Work

#: Instants that differ by this share of the horizon are the same: a control acts from its node on.
SAME_INSTANT = 1e-9

ControlKind = Literal["held", "linear", "polynomial", "extremal"]
_KINDS = get_args(ControlKind)


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution(Plottable):
    """A trajectory with its costates. Arrays are (N + 1, n): one row per instant.

    Attributes:
        problem: what was solved.
        solver: the solver, as text.
        status: how the solve ended.
        message: what and where, where the status alone does not say it.
        t: nodes [s], (N + 1,).
        x: states, (N + 1, nx).
        x0: the start that was asked for, (nx,); a guess of it where the start is free.
        costate: dJ*/dx at the nodes, (N + 1, nx); where a state bound is active the costate
            jumps, and the value just before the node is kept (by collocation just after it).
        u: controls, (N, nu) where held, else (N + 1, nu); of K polynomials the coefficients,
            (K m, nu), see ``PiecewisePolynomial``.
        control_kind: ``"held"`` between nodes, ``"linear"``, ``"polynomial"`` from break to
            break, or ``"extremal"``: the control minimising the Hamiltonian along state and
            costate.
        breaks: which nodes the pieces of a polynomial control meet at, (K + 1,), from 0 to N;
            empty for the other kinds.
        cost: as the solver computes it; ``evaluate`` integrates it independently.
        residual: the solver's own measure of optimality (its unit is the solver's).
        iterations: iterations of the outer method.
        work: integrations, Jacobians and factorisations.
        history: cost and residual per iteration, as far as the method has them.
        parameters: parameter values and signals of this run, by name.
        unknowns: values of the unknown constants, by name.
        build_time: time of ``build`` [s].
        solve_time: time of the method in ``run`` [s]; the comparison with the referee comes on top.
        normal: the same in the terms that the method got, see ``normal_form``; None where they
            are those of the problem.
    """

    problem: OCP
    solver: str
    status: Status
    message: str = ""
    t: np.ndarray
    x: np.ndarray
    x0: np.ndarray
    costate: np.ndarray
    u: np.ndarray
    control_kind: ControlKind = "held"
    breaks: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    cost: float
    residual: float = 0.0
    iterations: int = 0
    work: Work = field(default_factory=Work)
    history: Mapping[str, np.ndarray] = field(default_factory=dict)
    parameters: Mapping[str, np.ndarray] = field(default_factory=dict)
    unknowns: Mapping[str, np.ndarray] = field(default_factory=dict)
    build_time: float = 0.0
    solve_time: float = 0.0
    normal: "Solution | None" = field(default=None, repr=False)

    _called: ClassVar[str] = "a Solution"

    def __post_init__(self) -> None:
        """Check kinds and shapes, and that no number is NaN."""
        if self.control_kind not in _KINDS:
            known = ", ".join(_KINDS)
            raise ProblemError(f"solution: control_kind = {self.control_kind!r} is none of {known}")
        object.__setattr__(self, "breaks", np.asarray(self.breaks, dtype=int))
        check_fields(self)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is copied and pickled: the fields."""
        return without_caches(self)

    def __repr__(self) -> str:
        """Return one line: what was solved, how it ended, the cost as the solver computes it."""
        return (
            f"<Solution of '{self.problem.name}': {self.status.name}, cost {self.cost:.6g}, "
            f"{self.iterations} iterations, {len(self.t) - 1} intervals{self._hint}>"
        )

    def _repr_html_(self) -> str:
        """Return what was found in numbers, for a notebook."""
        constants = [
            (name, np.array2string(np.asarray(v), precision=6)) for name, v in self.unknowns.items()
        ]
        facts = [
            ("status", self.status.words),
            ("message", self.message or "-"),
            ("cost, the solver's own", f"{self.cost:.9g}"),
            ("duration [s]", f"{self.duration:.6g}"),
            *constants,
            ("solver", self.solver),
            ("iterations, intervals", f"{self.iterations}, {len(self.t) - 1}"),
            ("time to build and solve [s]", f"{self.build_time:.3g}, {self.solve_time:.3g}"),
        ]
        return html_of(f"Solution of {self.problem.name}", facts=facts)

    @property
    def _hint(self) -> str:
        """Where to read more about a failure."""
        return "" if self.status.is_success else "; solvers.diagnose(solution) looks for the cause"

    @property
    def duration(self) -> float:
        """Final time minus t0 [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def fractions(self) -> np.ndarray:
        """The nodes as fractions of the horizon, from 0 to 1."""
        return (self.t - self.t[0]) / self.duration

    @property
    def sizes(self) -> Sizes:
        """What states, controls, cost and rows are measured by: tolerances are relative to it."""
        return sizes_of(self.problem)

    @property
    def is_scaled(self) -> bool:
        """Whether solvers scale the problem by its sizes; one that is well scaled they do not."""
        return scaled(self.problem.explicit) is not None

    @property
    def data(self) -> RunData:
        """The numbers of the run it comes from."""
        start = self.problem.start_of(self.x0, self.x[0])
        values = self.problem.values_of(self.parameters, self.unknowns, start)
        return RunData(self.x0, float(self.t[0]), values)

    @property
    def sensitivity(self) -> dict[str, np.ndarray]:
        """dJ*/dk of every unknown constant: 0 inside its bounds, on a bound what that costs.

        Where controls have a ``Rate`` also of their ``"last_input"``, 0 where that is free; with a
        ``Delay`` of what was sent before.
        """
        return prices_of_constants(self)

    @property
    def peaks(self) -> dict[str, float]:
        """The largest values along the way, by name, as the solver has them at its nodes."""
        return largest_values(self)

    @property
    def multipliers(self) -> dict[str, np.ndarray]:
        """The price of every constraint on an integral, (m,), or at instants, (K, m), by name.

        dJ*/d(upper bound) is minus it.
        """
        return prices_of_constraints(self)

    @property
    def slack(self) -> dict[str, np.ndarray]:
        """Excess of soft constraints by name, (N, m) at all nodes but the last, (m,) at the end."""
        return excess_of_soft(self)

    @property
    def residuals(self) -> dict[str, np.ndarray]:
        """(h - y) / sigma of every measurement by name, (K, m), by the solution's own states."""
        values = self.data.values
        model = self.problem.model

        def states(fractions: np.ndarray) -> np.ndarray:
            return self.state(self.t[0] + fractions * self.duration).reshape(-1, model.nx)

        return data_residuals(self.problem, states, float(self.t[0]), values)

    def or_raise(self) -> "Solution":
        """Return self, or raise ``SolverError`` with the reason if the solve failed."""
        if not self.status.is_success:
            said = f"{self.solver}: {self.status.value}. {self.message}".strip()
            raise SolverError(f"{said}{self._hint}", self)
        return self

    def with_(self, **changes: Any) -> "Solution":
        """Return a copy with some fields replaced."""
        return replace(self, **changes)

    # -- between the nodes ----------------------------------------------------------

    def state(self, t: ArrayLike) -> np.ndarray:
        """Return the state at time(s) t [s], (nx,) or (len(t), nx).

        Interpolated linearly; for an extremal by cubics with the slopes of its canonical flow.
        """
        times = _instants(t, "state")
        if self.control_kind == "extremal":
            return self._extremal.state(times)
        return _interpolate(times, self.t, self.x)

    def costate_at(self, t: ArrayLike) -> np.ndarray:
        """Return the costate at time(s) t [s], interpolated as the state is."""
        times = _instants(t, "costate_at")
        if self.control_kind == "extremal":
            return self._extremal.costate_at(times)
        return _interpolate(times, self.t, self.costate)

    def control(self, t: ArrayLike) -> np.ndarray:
        """Return the control at time(s) t [s], (nu,) or (len(t), nu), as its kind says.

        That of an extremal is accurate to O(h^4), h the distance of the nodes, where the
        signals of the problem are smooth between them.
        """
        times = _instants(t, "control")
        if self.control_kind == "extremal":
            return self._extremal.control(times)
        if self.control_kind == "held":
            index = np.searchsorted(self.t, times + SAME_INSTANT * self.duration, side="right") - 1
            return self.u[np.clip(index, 0, len(self.u) - 1)]
        if self.control_kind == "linear":
            return _interpolate(times, self.t, self.u)
        values = self.pieces.at(np.atleast_1d(times))
        return values if times.ndim else values[0]

    def algebraic(self, t: ArrayLike) -> np.ndarray:
        """Return the algebraic variables at time(s) t [s], (nz,) or (len(t), nz).

        They are those of state and control there, as the problem's own equations give them.
        """
        times = _instants(t, "algebraic")
        points = np.atleast_1d(times)
        p = self.data.values.at((points - self.t[0]) / self.duration)
        given = (self.state(points), self.control(points), points[:, None], p)
        along = self.problem.functions.algebraic.map(len(points))
        values = np.array(along(*[a.T for a in given])).T
        return values if times.ndim else values[0]

    @property
    def z(self) -> np.ndarray:
        """The algebraic variables at the nodes, (N + 1, nz)."""
        return self.algebraic(self.t)

    @cached_property
    def _extremal(self) -> Extremal | RewrittenExtremal:
        """States, costates and controls of an extremal between its nodes."""
        form = None if self.normal is None else normal_form(self.problem)
        if form is None or self.normal is None:
            return Extremal(self.problem, self.data, self.t, self.x, self.costate)
        return RewrittenExtremal(form, self.normal)

    @cached_property
    def pieces(self) -> PiecewisePolynomial:
        """The polynomials of a control of that kind."""
        count = len(self.breaks) - 1
        coefficients = self.u.reshape(count, len(self.u) // count, self.problem.model.nu)
        return PiecewisePolynomial(self.t[self.breaks], coefficients)

    def sample(self, part: str, fractions: np.ndarray, width: int) -> np.ndarray | None:
        """Return x, u or costate at fractions of the horizon: a solution is also a guess."""
        times = self.t[0] + np.asarray(fractions) * self.duration
        values = {"x": self.state, "u": self.control, "costate": self.costate_at}[part](times)
        if values.shape[1] != width:
            raise ProblemError(
                f"guess: the solution has {values.shape[1]} of {part}, {width} are needed"
            )
        return values

    def states_apart(self, other: "Solution") -> float:
        """Return the largest distance from the states of another at the nodes of the coarser grid.

        Taken at the same fractions of both horizons.
        """
        coarse, fine = sorted((self, other), key=lambda solution: len(solution.t))
        there = fine.sample("x", coarse.fractions, coarse.x.shape[1])
        return float(np.abs(coarse.x - there).max())

    # -- pictures and files --------------------------------------------------------

    @property
    def _pictured(self) -> Pictured:
        """What a picture says of it."""
        name = self.problem.name
        return Pictured(name, self.status, self.message, self.cost, self.unknowns, (self,), (name,))

    def save(self, path: str | Path) -> Path:
        """Write everything to one ``.npz`` file, the problem as its ``probe``; return its path.

        A file of that name is replaced when the new one is whole and on the disk.

        Raises:
            ProblemError: if it cannot be written; a file that was there is as it was.
        """
        content = content_of(self) | fingerprint_entries(self.problem)
        return write_archive(path, "solution", content)

    @classmethod
    def load(cls, path: str | Path, problem: OCP) -> "Solution":
        """Read a solution of ``problem`` from a file that ``save`` wrote.

        Raises:
            ProblemError: if the file cannot be read, or belongs to another problem, by its name or
                by what the problem's functions and bounds are (older files know only the name).
            DamagedFile: if it is no solution, or not as it was saved (older files have no
                checksum); ``whole_arrays`` reads what is left of it.
        """
        check_instance(problem, OCP, f"the problem that {path} is to be a solution of")
        fields = read_fields(path, problem)
        with made_of(path, "solution"):
            return cls._of(fields)

    @classmethod
    def _of(cls, fields: Mapping[str, Any]) -> "Solution":
        """Return the solution with these fields, those of its normal form among them."""
        normal = None if fields["normal"] is None else cls._of(fields["normal"])
        return cls(**{**fields, "normal": normal})


def _instants(t: ArrayLike, what: str) -> np.ndarray:
    """Return times [s] as an array of at most one axis, checked."""
    times = check_numeric(t, f"solution.{what}: t [s]")
    if times.ndim > 1:
        raise ProblemError(f"solution.{what}: t has shape {times.shape}, one axis is needed")
    if not np.isfinite(times).all():
        raise ProblemError(f"solution.{what}: t is not finite")
    return times


def _interpolate(t: np.ndarray, nodes: np.ndarray, rows: np.ndarray) -> np.ndarray:
    columns = [np.interp(t, nodes, c) for c in rows.T]
    return np.stack(columns, axis=-1) if columns else np.empty((*t.shape, 0))
