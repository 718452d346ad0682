"""What a solver returns: a trajectory, its costates, and how it was found."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly

from ocp.checks.arguments import check_instance, check_numeric
from ocp.checks.errors import ProblemError, SolverError
from ocp.checks.rich_text import html_of
from ocp.files.archive import made_of, write_archive
from ocp.minimum_principle.necessary_conditions import minimum_principle
from ocp.normal_form.normal_form import NormalForm, normal_form
from ocp.plotting.compare import compared
from ocp.plotting.plottable import Pictured
from ocp.plotting.view import View
from ocp.problem.constraint import Constraint
from ocp.problem.data_residuals import data_residuals
from ocp.problem.fingerprint import fingerprint_entries
from ocp.problem.nominal_sizes import Sizes
from ocp.problem.ocp import OCP
from ocp.problem.portable import without_caches
from ocp.problem.run_data import RunData
from ocp.problem.scaled import scaled, sizes_of
from ocp.solution.piecewise_polynomial import PiecewisePolynomial
from ocp.solution.solution_file import ARRAYS, content_of, read_fields
from ocp.solution.status import Status
from ocp.solution.work import Work

if TYPE_CHECKING:
    from ocp.plotting.picture import Picture

ControlKind = Literal["held", "linear", "polynomial", "extremal"]
_KINDS = get_args(ControlKind)


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
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

    def __post_init__(self) -> None:
        """Check kinds and shapes, and that no number is NaN."""
        check_instance(self.problem, OCP, "solution: problem")
        check_instance(self.status, Status, "solution: status")
        if self.control_kind not in _KINDS:
            known = ", ".join(_KINDS)
            raise ProblemError(f"solution: control_kind = {self.control_kind!r} is none of {known}")
        for name in ARRAYS:
            if not isinstance(array := getattr(self, name), np.ndarray):
                check_instance(array, np.ndarray, f"solution: {name}")
        n, m = len(self.t), self.problem.model
        object.__setattr__(self, "breaks", np.asarray(self.breaks, dtype=int))
        rows = n - 1 if self.control_kind == "held" else n
        if self.control_kind == "polynomial":
            rows = self._check_breaks()
        for name, shape in (
            ("t", (n,)),
            ("x", (n, m.nx)),
            ("x0", (m.nx,)),
            ("costate", (n, m.nx)),
            ("u", (rows, m.nu)),
        ):
            array = getattr(self, name)
            if array.shape != shape:
                raise ProblemError(f"solution: {name} has shape {array.shape}, {shape} is needed")
            if not _is_finite(array):
                raise ProblemError(f"solution: {name} is not finite")
        if n < 2 or np.count_nonzero(self.t[1:] > self.t[:-1]) < n - 1:
            raise ProblemError("solution: t does not increase from node to node")
        for name in ("cost", "residual"):
            value = getattr(self, name)
            if not isinstance(value, float):
                check_instance(value, (float, int, np.floating, np.integer), f"solution: {name}")
            if value != value:
                raise ProblemError(f"solution: {name} is NaN")

    def _check_breaks(self) -> int:
        """Return how many coefficients there must be: as many as there are, if that fits."""
        last, breaks = len(self.t) - 1, self.breaks
        increasing = breaks.ndim == 1 and len(breaks) > 1 and (np.diff(breaks) > 0).all()
        if not increasing or breaks[0] != 0 or breaks[-1] != last:
            raise ProblemError(f"solution: breaks = {breaks}, they must increase from 0 to {last}")
        pieces = len(breaks) - 1
        return max(1, len(self.u) // pieces) * pieces

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
    def _form(self) -> NormalForm | None:
        """The normal form that was solved; None where it is the problem itself."""
        return None if self.normal is None else normal_form(self.problem)

    @property
    def sensitivity(self) -> dict[str, np.ndarray]:
        """dJ*/dk of every unknown constant: 0 inside its bounds, on a bound what that costs.

        Where controls have a ``Rate`` also of their ``"last_input"``, 0 where that is free; with a
        ``Delay`` of what was sent before.
        """
        form = self._form
        if form is None or self.normal is None:
            return {}
        costate = self.normal.costate[0]
        sent = {"last_input": form.last_input} if self.problem.rates else {}
        places = form.unknowns | form.histories | sent
        return {name: costate[at] for name, at in places.items()}

    @property
    def peaks(self) -> dict[str, float]:
        """The largest values along the way, by name, as the solver has them at its nodes."""
        form = self._form
        if form is None or self.normal is None:
            return {}
        return {name: float(self.normal.x[0, at][0]) for name, at in form.peaks.items()}

    @property
    def multipliers(self) -> dict[str, np.ndarray]:
        """The price of every constraint on an integral, (m,), or at instants, (K, m), by name.

        dJ*/d(upper bound) is minus it.
        """
        form = self._form
        if form is None or self.normal is None:
            return {}
        costate = self.normal.costate[-1]
        found = {name: costate[at] for name, at in form.integrals.items()}
        for c in self.problem.at("instants"):
            found[c.name] = costate[form.waypoints.places[c.name]].reshape(-1, c.size)
        return found

    @property
    def slack(self) -> dict[str, np.ndarray]:
        """Excess of soft constraints by name, (N, m) at all nodes but the last, (m,) at the end."""
        ocp, count, values = self.problem, len(self.t) - 1, self.data.values
        x, u, t = self.x[:-1].T, self.control(self.t[:-1]).T, self.t[None, :-1]
        path = ocp.functions.path.map(count)(x, u, t, values.at(self.fractions[:-1]).T)
        end = ocp.functions.terminal(self.x[-1], self.t[-1], values.at(1.0)[0])
        return {
            c.name: c.box.excess(rows if c.at == "path" else rows[0])
            for values, constraints in ((path, ocp.at("path")), (end, ocp.at("terminal")))
            for c, rows in _split(constraints, np.array(values).T)
            if c.soft is not None
        }

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
            return self._canonical(times)[..., : self.problem.model.nx]
        return _interpolate(times, self.t, self.x)

    def costate_at(self, t: ArrayLike) -> np.ndarray:
        """Return the costate at time(s) t [s], interpolated as the state is."""
        times = _instants(t, "costate_at")
        if self.control_kind == "extremal":
            return self._canonical(times)[..., self.problem.model.nx :]
        return _interpolate(times, self.t, self.costate)

    def control(self, t: ArrayLike) -> np.ndarray:
        """Return the control at time(s) t [s], (nu,) or (len(t), nu), as its kind says.

        That of an extremal is accurate to O(h^4), h the distance of the nodes, where the
        signals of the problem are smooth between them.
        """
        times = _instants(t, "control")
        form = self._form
        if self.control_kind == "extremal" and self.normal is not None and form is not None:
            return form.own_controls(self.normal.state(times), self.normal.control(times))
        if self.control_kind == "held":
            index = np.searchsorted(self.t, times + 1e-9 * self.duration, side="right") - 1
            return self.u[np.clip(index, 0, len(self.u) - 1)]
        if self.control_kind == "linear":
            return _interpolate(times, self.t, self.u)
        if self.control_kind == "polynomial":
            values = self.pieces.at(np.atleast_1d(times))
            return values if times.ndim else values[0]
        points = np.atleast_1d(times)
        tau = (points - self.t[0]) / self.duration
        p = self.data.values.at(tau)
        law = minimum_principle(self.problem).control
        args = (self.state(points), self.costate_at(points), points[:, None], p)
        values = np.array(law.map(len(points))(*[a.T for a in args])).T
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

    def _canonical(self, t: np.ndarray) -> np.ndarray:
        """State and costate of an extremal."""
        if self.normal is not None:
            m = self.problem.model
            x, costate = self.normal.state(t), self.normal.costate_at(t)
            form = normal_form(self.problem)
            if form is None or not form.has_jumps:
                return np.concatenate([x[..., : m.nx], costate[..., : m.nx]], axis=-1)
            points, values = np.atleast_1d(t), self.normal.data.values
            fractions = (points - self.t[0]) / self.duration
            own = form.costate(np.atleast_2d(x), np.atleast_2d(costate), points, fractions, values)
            return np.concatenate([x[..., : m.nx], own.reshape(*t.shape, m.nx)], axis=-1)
        return self._cubics(np.clip(t, self.t[0], self.t[-1]))

    @cached_property
    def _cubics(self) -> PPoly:
        """State and costate of an extremal between its nodes; signals may jump at the nodes."""
        z, steps = np.hstack([self.x, self.costate]), np.diff(self.t)[:, None]
        flow = minimum_principle(self.problem).flow.map(len(steps))
        p_start, p_end = self.data.values.on(self.fractions)
        slope = np.array(flow(z[:-1].T, self.t[None, :-1], p_start.T)).T
        slope_end = np.array(flow(z[1:].T, self.t[None, 1:], p_end.T)).T
        secant = np.diff(z, axis=0) / steps
        square = (3 * secant - 2 * slope - slope_end) / steps
        cube = (slope + slope_end - 2 * secant) / steps**2
        return PPoly(np.stack([cube, square, slope, z[:-1]]), self.t)

    # -- pictures and files --------------------------------------------------------

    def plot(
        self,
        variables: Sequence[str] = (),
        *,
        compare: "Solution | Mapping[str, Solution] | None" = None,
        against: str = "time",
        time_unit: str = "s",
        constraints: str = "active",
        costates: bool = False,
        plane: Sequence[str] | None = None,
    ) -> "Picture":
        """Return a picture: a panel for each variable, with its bounds, references and data.

        Variables with the same unit and a like size share a panel. Limits are hatched; path
        constraints of a single variable are limits of it, others have panels of their own. A
        signal that the running cost compares with a variable is drawn as its reference.

        Args:
            variables: names of what is drawn, in this order: states, algebraic variables,
                controls, ``"rate of u"``, signals, constraints, measurements, invariants, or
                costates ``"∂J/∂(x)"``. Empty: everything but costates and invariants.
            compare: another solution, or several by name: ``{"warm": other}``. Their problems
                may differ, the names of their states and controls may not.
            against: name of what is on the horizontal axis.
            time_unit: ``"ms"``, ``"s"``, ``"min"``, ``"h"`` or ``"d"``.
            constraints: which path constraints have a panel: the ``"active"`` ones, that is those
                that come to a limit, ``"all"`` or ``"none"``.
            costates: whether they are drawn as well.
            plane: two names ``(x, y)``: one picture of y over x instead, a phase plane.

        Returns:
            a matplotlib ``Figure``; ``picture["speed"]`` are the axes that show the speed. The
            cost in its title is the solver's own; only ``evaluate`` says what the controls do.

        Raises:
            ProblemError: if a name is of nothing, a unit is none, or problems do not compare.
        """
        # matplotlib takes a second to import: only who plots waits
        from ocp.plotting.plot import plot

        view = View(variables, against, time_unit, constraints, costates)
        shown = compared(self, compare, Solution, "a Solution")
        return plot({label: s._pictured for label, s in shown.items()}, view, plane)

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


def _split(
    constraints: tuple[Constraint, ...], values: np.ndarray
) -> Iterator[tuple[Constraint, np.ndarray]]:
    """Yield constraints with their columns of stacked values (k, m)."""
    ends = np.cumsum([c.size for c in constraints])
    yield from zip(constraints, np.split(values, ends, axis=1), strict=False)


def _is_finite(array: np.ndarray) -> bool:
    """Whether every number is finite; so it is where the sum of squares is, one quick operation."""
    return isfinite(np.vdot(array, array)) or bool(np.isfinite(array).all())


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
