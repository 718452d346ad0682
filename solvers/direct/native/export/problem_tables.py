"""What the C of a loop knows of its problem: sizes, and tables for the user's numbers."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp import RK4, InitialGuess
from ocp.internal import RunData, Stage, check_whole, sizes_of
from solvers.direct.native.export.c_text import affine, numbers, terms, whole_numbers
from solvers.direct.native.export.exported_loop import ExportedLoop
from solvers.direct.native.flat_rows import FlatRows
from solvers.direct.native.native_solve import COLD, WARM


@dataclass(frozen=True, eq=False)
class ProblemTables:
    """Constants of the generated C.

    What the solver gets of the user's numbers is affine in them: start and data of the nodes are
    constants plus weights times states and parameters. The weights are found by asking for the
    data of unit vectors.

    Attributes:
        loop: what is exported.
    """

    loop: ExportedLoop

    # -- sizes -----------------------------------------------------------------------------------

    @cached_property
    def counts(self) -> dict[str, int]:
        """Sizes in the terms of the user."""
        loop, m = self.loop, self.loop.original.model
        return {
            "INTERVALS": loop.program.transcription.n,
            "USER_NX": m.nx,
            "USER_NU": m.nu,
            "INPUTS": loop.input_size,
            "SENDS_RATE": int(loop.sends_rate),
            "USER_NP": len(self._declared),
            "USER_P": loop.original.p.numel(),
            "FORM_NX": loop.program.ocp.model.nx,
            "DELAY_STEPS": round(loop.delay / loop.dt),
            "COMPENSATES": int(loop.compensates),
            "IS_DISCRETE": int(m.is_discrete),
            "HAS_FREE_TIME": int(loop.original.has_free_time),
            "HAS_FIRST_STATES": int(self._first.has_states),
            "HAS_FIRST_COSTATES": int(self._first.costate is not None),
            "MOST_ITERATIONS": check_whole(loop.program.solver.max_iterations, "max_iterations"),
        }

    @cached_property
    def reals(self) -> dict[str, float]:
        """Single numbers."""
        loop, scaling = self.loop, self.loop.in_sizes
        is_moved = loop.form is not None and len(loop.form.rates) > 0
        return {
            "SAMPLING": loop.dt,
            # Where controls that move are read off in the middle of an interval, so are the others.
            "BETWEEN": 0.5 * loop.dt if is_moved else 0.0,
            "DELAY": loop.delay,
            "DURATION": loop.original.duration,
            "TIME_UNIT": loop.program.transcription.time_unit,
            "COST_SIZE": scaling.scaled.sizes.cost if scaling else 1.0,
            "TOLERANCE": loop.program.solver.tolerance,
            "ACCURACY": loop.program.solver.accuracy,
            "WARM_BARRIER": WARM,
            "COLD_BARRIER": COLD,
        }

    @property
    def constants(self) -> dict[str, int]:
        """Unknown constants of the problem by name, with their numbers of components."""
        form = self.loop.form
        return {n: at.stop - at.start for n, at in form.unknowns.items()} if form else {}

    # -- the C -----------------------------------------------------------------------------------

    @property
    def code(self) -> str:
        """All of it, to stand before the C of the loop."""
        lines = [f"#define {name} {value}" for name, value in self.counts.items()]
        lines += [f"#define {name} {value!r}" for name, value in self.reals.items()]
        lines += ["", "typedef struct {", "  int row, column;", "  double weight;", "} Term;", ""]
        lines += ["#define COUNT(table) ((int)(table##_count))", ""]
        return "\n".join([*lines, *self._start(), *self._data(), *self._bounds(), *self._others()])

    def _start(self) -> list[str]:
        """The start of the solver, of state and parameters."""
        nx, n_p = self.counts["USER_NX"], self.counts["USER_NP"]
        pad = self._free_time_guess

        def of_state(x0: np.ndarray) -> np.ndarray:
            return np.append(self.loop.run_data(x0, np.zeros(n_p)).x0, pad)

        def of_parameters(flat: np.ndarray) -> np.ndarray:
            return np.append(self.loop.run_data(np.zeros(nx), flat).x0, pad)

        constants, by_state = _affine(of_state, nx)
        _, by_parameters = _affine(of_parameters, n_p)
        return [
            numbers("start_constants", constants),
            terms("start_of_state", by_state),
            terms("start_of_parameters", by_parameters),
        ]

    def _data(self) -> list[str]:
        """Data of the nodes, and the parameters of the first instant, of the parameters."""
        loop, n_p = self.loop, self.counts["USER_NP"]
        code, tr = loop.solve.library.code, loop.program.transcription

        def of_nodes(flat: np.ndarray) -> np.ndarray:
            return code.data(tr.data_vector(loop.run_data(self._x0, flat))).ravel()

        def now(flat: np.ndarray) -> np.ndarray:
            return loop.original.parameter_values(loop.by_name(flat)).at(0.0)[0]

        rows = loop.original.control_rates.index if "last_input" in loop.parameters else []
        at = self._offsets.get("last_input", 0)
        inputs = [(at + i, int(j), 1.0) for i, j in enumerate(rows)]
        return [
            *affine("data", *_affine(of_nodes, n_p)),
            *(affine("now", *_affine(now, n_p)) if self._looks_at_now else ()),
            terms("last_inputs", inputs if loop.controller else []),
        ]

    def _bounds(self) -> list[str]:
        """Bounds of all nodes, and what is given."""
        tr, code = self.loop.program.transcription, self.loop.solve.library.code
        bounds, flat = tr.bounds(self._run), FlatRows.of(code)
        low, high = (np.full(code.flat_size, side) for side in (-np.inf, np.inf))
        for side, x, g in ((low, "lbx", "lbg"), (high, "ubx", "ubg")):
            side[flat.bounded] = bounds[x][flat.in_unknowns]
            side[flat.rows] = bounds[g][flat.in_rows]
        given = bounds["lbx"] == bounds["ubx"]
        controls = np.where(given, bounds["lbx"], 0.0)[flat.u][0]
        return [
            numbers("lower_bounds", low),
            numbers("upper_bounds", high),
            numbers("start_given", given[flat.x[0]].astype(float)),
            numbers("control_given", given[flat.u][0].astype(float)),
            numbers("given_controls", controls),
        ]

    def _others(self) -> list[str]:
        """First iterate, sizes, and the controls of the user among states and controls."""
        loop, original, m = self.loop, self.loop.original, self.loop.program.ocp.model
        sizes = loop.in_sizes.scaled.sizes if loop.in_sizes else None
        of_x = np.ones(m.nx) if sizes is None else np.asarray(sizes.x)
        of_u = np.ones(m.nu) if sizes is None else np.asarray(sizes.u)
        from_ = m.nx + np.arange(m.nu) if loop.form is None else loop.form.controls
        box, state_box = loop.input_box, np.abs(_sides(loop.program.ocp.state_bounds))
        first, tr = self._first, loop.program.transcription
        costate = np.zeros((tr.n + 1, tr.nz)) if first.costate is None else first.costate
        lower, upper = (np.asarray(side, dtype=float) for side in (box.lower, box.upper))
        unknowns = loop.form.unknowns.values() if loop.form else ()
        places = [i for at in unknowns for i in range(at.start, at.stop)]
        return [
            numbers("fractions", tr.fractions),
            numbers("first_states", tr.with_time(first.x, self._free_duration)),
            numbers("first_controls", first.u),
            numbers("first_costates", costate),
            numbers("state_sizes", loop.solve.library.code.sizes),
            numbers("bound_sizes", np.where(np.isfinite(state_box), state_box, 0.0).max(axis=0)),
            numbers("user_sizes", sizes_of(original).x),
            numbers("user_scales", of_x[: original.model.nx]),
            whole_numbers("control_from", from_),
            numbers("control_sizes", np.concatenate([of_x, of_u])[from_]),
            numbers("input_lower", lower),
            numbers("input_upper", upper),
            numbers("declared_start", self._x0),
            numbers("declared_parameters", self._declared),
            terms("constants", [(i, 0, float(of_x[i])) for i in places]),
        ]

    @cached_property
    def of_instant(self) -> tuple[ca.Function, ...]:
        """What is sent, where that is a rate; else the user's state a sampling interval later."""
        if not self._looks_at_now:
            return ()
        ocp, m = self.loop.original, self.loop.original.model
        x, u, t, p = (ca.SX.sym("x", k) for k in (m.nx, m.nu, 1, ocp.p.numel()))
        if self.loop.sends_rate:
            (rate,) = ocp.functions.rate.call([x, u, t, p])
            return (ca.Function("sent", [x, u, t, p], ca.cse([ca.densify(rate)])),)
        after, _ = Stage.of(ocp, RK4(), held=True).step.call([x, u, t, ca.SX(self.loop.dt), p, p])
        return (ca.Function("interval", [x, u, t, p], ca.cse([ca.densify(after)])),)

    @property
    def _looks_at_now(self) -> bool:
        """Whether a function of the instant is called."""
        return self.loop.sends_rate or self.counts["DELAY_STEPS"] > 0

    # -- what they are made of -------------------------------------------------------------------

    @cached_property
    def _x0(self) -> np.ndarray:
        return self.loop.original.start()

    @cached_property
    def _declared(self) -> np.ndarray:
        return self.loop.flat({})

    @cached_property
    def _run(self) -> RunData:
        return self.loop.run_data(self._x0, self._declared)

    @cached_property
    def _offsets(self) -> dict[str, int]:
        """Where each parameter begins."""
        sizes = [value.size for value in self.loop.parameters.values()]
        return dict(zip(self.loop.parameters, np.cumsum([0, *sizes]).tolist(), strict=False))

    @property
    def _free_duration(self) -> float:
        guess = self._guess
        duration = guess.duration if guess and self.loop.original.has_free_time else None
        return duration or self.loop.original.duration

    @property
    def _free_time_guess(self) -> list[float]:
        """The final time where it is free, as the last entry of the start."""
        unit = self.loop.program.transcription.time_unit
        return [self._free_duration / unit] if self.loop.original.has_free_time else []

    @cached_property
    def _guess(self) -> InitialGuess | None:
        """The guess that a first step starts from, in terms of the solver."""
        loop = self.loop
        original, flat = loop.original, self._declared
        guess = original.first_guess(loop.controller.guess if loop.controller else None)
        data, given = RunData.of(original, self._x0, 0.0), loop.by_name(flat)
        for each in loop.rewritings:
            guess = None if guess is None else each.guess(guess, data)
            start, given = each.start(data), each.parameters(given)
            data = RunData.of(each.problem, start, 0.0, given)
        return loop.program.ocp.first_guess(guess)

    @cached_property
    def _first(self) -> "_FirstIterate":
        program, guess = self.loop.program, self._guess
        x, u = program.first_iterate(self._run, guess)
        x = x[:, : program.ocp.model.nx]
        nodes, nx = program.transcription.fractions, program.ocp.model.nx
        has_states = guess is not None and guess.sample("x", nodes, nx) is not None
        costate = guess.sample("costate", nodes, nx) if guess is not None and has_states else None
        if costate is not None:
            costate = np.hstack([costate, np.zeros((len(costate), len(self._free_time_guess)))])
        return _FirstIterate(x, u, costate, has_states)


@dataclass(frozen=True, eq=False)
class _FirstIterate:
    """States (N + 1, nx), controls (N, nu), costates where they are known; whether states are."""

    x: np.ndarray
    u: np.ndarray
    costate: np.ndarray | None
    has_states: bool


def _sides(box: object) -> np.ndarray:
    return np.vstack([np.asarray(getattr(box, side), dtype=float) for side in ("lower", "upper")])


def _affine(
    function: Callable[[np.ndarray], np.ndarray], count: int
) -> tuple[np.ndarray, list[tuple[int, int, float]]]:
    """Return an affine function of ``count`` numbers: its constants, and its weights."""
    constants, found = function(np.zeros(count)), []
    for column, unit in enumerate(np.eye(count)):
        change = function(unit) - constants
        found += [(int(row), column, float(change[row])) for row in np.flatnonzero(change)]
    return constants, found
