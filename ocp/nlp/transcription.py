"""A problem on a grid as a nonlinear program, shared by the direct solvers."""

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.checks.arguments import check_instance
from ocp.codegen.compile import compiled
from ocp.integration.differentiable_step import differentiable_step
from ocp.integration.one_step import ExplicitIntegrator, Integrator, Stage
from ocp.nlp.blocked_rows import held_rows, on_held_controls, rows_by_stage
from ocp.nlp.start_slope import start_slope, step_with_fixed_start
from ocp.nlp.unknowns_layout import UnknownsLayout
from ocp.nlp.violated_row import most_violated
from ocp.problem.constraint_rows import ConstraintRow, ConstraintRows
from ocp.problem.control_blocks import ControlBlocks
from ocp.problem.node_fractions import node_fractions, node_widths
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData


@dataclass(frozen=True, eq=False)
class Transcription(UnknownsLayout):
    r"""Multiple shooting: states at nodes, controls held, integration in between.

    .. math:: x_{k+1} - F(x_k, u_k) = 0, \quad k = 0 \dots N-1

    Constraints are ordered stage by stage, as the unknowns are, so that both a general sparse and
    a stagewise solver see their structure; a free final time adds T_{k+1} = T_k. Path constraints
    hold at the nodes; what the start alone decides is not imposed there. The stage is built once
    and mapped.

    Attributes:
        ocp: the problem.
        intervals: number of intervals N; a discrete-time problem brings its own.
        integrator: one-step method of each interval.
        compiled: whether stage and path constraints run as machine code.
        start_as_data: whether a fixed start enters the first stage as a number along which nothing
            is differentiated, for starts where a slope is not finite. z_0 stays an unknown
            with equal bounds, so that the stages keep their structure.
        nodes: as fractions of the horizon, (N + 1,); None: see ``node_fractions``.
        blocks: controls that are held over several intervals, see ``blocked_rows``.
    """

    integrator: Integrator
    compiled: bool = False
    start_as_data: bool = False
    nodes: np.ndarray | None = None
    blocks: ControlBlocks | None = None

    def __post_init__(self) -> None:
        """Refuse what is no problem; the numbers are checked by the solvers."""
        check_instance(self.ocp, OCP, "the problem to transcribe")

    @property
    def fractions(self) -> np.ndarray:
        """Nodes as fractions of the horizon, (N + 1,)."""
        return self._fractions

    @cached_property
    def _fractions(self) -> np.ndarray:
        return node_fractions(self.ocp, self.n) if self.nodes is None else self.nodes

    # -- the stage ----------------------------------------------------------------------

    @cached_property
    def step(self) -> ca.Function:
        """One interval: (x, u, t, h, p0, p1) -> (x after it, cost), ``Stage.step``."""
        if self.compiled and isinstance(self.integrator, ExplicitIntegrator):
            return self._fast(differentiable_step(self.ocp, self.integrator))
        return self._fast(Stage.of(self.ocp, self.integrator, held=True).step)

    @cached_property
    def _path(self) -> ca.Function:
        path = self.ocp.functions.path
        return self._fast(path) if path.numel_out(0) else path

    def _fast(self, function: ca.Function) -> ca.Function:
        """Compile, where asked for, with derivatives along what depends on the unknowns."""
        if not self.compiled:
            return function
        unknown = {"x", "u", "u0"} | ({"t", "h"} if self.ocp.has_free_time else set())
        return compiled(function, along=[n for n in function.name_in() if n in unknown])

    # -- the program --------------------------------------------------------------------

    @cached_property
    def program(self) -> dict[str, ca.MX]:
        """Unknowns x, cost f, constraints g and data p, as ``casadi.nlpsol`` takes them."""
        ocp, nx, nu, n_p, n = (
            self.ocp,
            self.ocp.model.nx,
            self.ocp.model.nu,
            self.ocp.p.numel(),
            self.n,
        )
        w = ca.MX.sym("w", self.size)
        fixed = nx if self.start_as_data else 0
        data = ca.MX.sym("data", 1 + n_p * (2 * n + 1) + fixed)
        t0 = data[0]
        p_left = ca.reshape(data[1 : 1 + n_p * n], n_p, n)
        p_right = ca.reshape(data[1 + n_p * n : 1 + 2 * n_p * n], n_p, n)
        p_final = data[1 + 2 * n_p * n : 1 + n_p * (2 * n + 1)]
        stages = ca.reshape(w[: -self.nz], self.nz + nu, n)
        z = ca.horzcat(stages[: self.nz, :], w[-self.nz :])
        x, u = z[:nx, :], stages[self.nz :, :]
        duration = ca.DM(np.full((1, n), ocp.duration))
        if ocp.has_free_time:
            duration = self.time_unit * z[nx, :-1]
        h = duration * ca.DM(node_widths(self.fractions)).T
        t = t0 + duration * ca.DM(self.fractions[:-1]).T
        t_final = t0 + (self.time_unit * z[nx, -1] if ocp.has_free_time else ocp.duration)
        stages, nodes = [x[:, :-1], u, t, h, p_left, p_right], [x[:, :-1], u, t, p_left]
        if self.start_as_data:
            x0 = data[data.numel() - nx :]
            after, costs = step_with_fixed_start(self.step, n, x0, stages)
            (inside,) = step_with_fixed_start(self._path, n, x0, nodes)
        else:
            after, costs = self.step.map(n)(*stages)
            inside = self._path.map(n)(*nodes)
        if ocp.has_free_time:
            after = ca.vertcat(after, z[nx, :-1])
        first = ocp.functions.initial(x[:, 0], t0, p_left[:, 0] if n_p else ca.DM(0, 1))
        stages = rows_by_stage(z[:, 1:] - after, u, inside, self.blocks)
        last = self.last(x[:, -1], t_final, p_final)
        g = ca.vertcat(stages[0], first, *stages[1:], last)
        f = ca.sum2(costs) + ocp.functions.terminal_cost(x[:, -1], t_final, p_final)
        return {"x": w, "f": f, "g": g, "p": data}

    @cached_property
    def rows(self) -> tuple[ConstraintRow, ...]:
        """What each row of g says, in order."""
        ocp = self.ocp
        gap = [
            ConstraintRow(f"dynamics of {name}", "dynamics", 1, 0.0, 0.0)
            for name in ocp.model.x_names
        ]
        gap += [ConstraintRow("final time", "time", 1, 0.0, 0.0)] * int(ocp.has_free_time)
        held, repeats = held_rows(ocp, self.blocks)
        repeated = on_held_controls(ocp, self.blocks)
        path = ocp.rows.path.rows
        rows: list[ConstraintRow] = []
        for k in range(self.n):
            rows += [replace(row, node=k + 1) for row in gap]
            rows += [replace(row, node=k + 1) for row in held if k + 1 in repeats]
            for row, is_decided, is_said in zip(path, ocp.decided_by_start, repeated, strict=True):
                free = (k == 0 and is_decided) or (k in repeats and is_said)
                bounds = {"lower": -np.inf, "upper": np.inf} if free else {}
                rows.append(replace(row, node=k, **bounds))
            if k == 0:
                rows += ocp.rows.initial.rows
        rows += [replace(row, node=self.n) for row in self.last_rows.rows]
        return tuple(rows)

    def bounds(self, data: RunData) -> dict[str, np.ndarray]:
        """Return lbx, ubx, lbg, ubg for a start."""
        ocp, result = self.ocp, {}
        for key, side in (("lbx", "lower"), ("ubx", "upper")):
            bound = self._bounds[key].copy()
            at_start = np.asarray(getattr(ocp.start_box, side))
            bound[: ocp.model.nx] = ocp.start_of(data.x0, at_start)
            result[key] = bound
        return result | {key: self._bounds[key].copy() for key in ("lbg", "ubg")}

    @cached_property
    def _bounds(self) -> dict[str, np.ndarray]:
        """What does not depend on the start."""
        ocp, nu = self.ocp, self.ocp.model.nu
        state, time, control = ocp.state_bounds, ocp.time_box, ocp.control_bounds
        result = {}
        for key, side in (("lbx", "lower"), ("ubx", "upper")):
            z = np.tile(np.asarray(getattr(state, side)), (self.n + 1, 1))
            if ocp.has_free_time:
                bound = np.asarray(getattr(time, side))[0] / self.time_unit
                z = np.hstack([z, np.full((self.n + 1, 1), bound)])
            u = np.tile(np.asarray(getattr(control, side)).reshape(nu), (self.n, 1))
            result[key] = self.join(z, u)
        result["lbg"] = np.array([r.lower for r in self.rows])
        result["ubg"] = np.array([r.upper for r in self.rows])
        return result

    def data_vector(self, data: RunData) -> np.ndarray:
        """Return the numbers of the program's p."""
        left, right = data.values.on(self.fractions)
        x0 = data.x0 if self.start_as_data else []
        final = data.values.at(1.0)[0]
        return np.concatenate([[data.t0], left.ravel(), right.ravel(), final, x0])

    def worst(
        self, w: np.ndarray, g: np.ndarray, bounds: dict[str, np.ndarray]
    ) -> tuple[float, ConstraintRow | None]:
        """Return the largest violation of any constraint or state bound, and which it is."""
        return most_violated(w, g, bounds, self.rows, self._bound)

    def _bound(self, i: int) -> ConstraintRow:
        """Return what the bound of an unknown says."""
        node, entry = divmod(i, self.nz + self.ocp.model.nu)
        names = [*self.ocp.model.x_names, *["final time"] * int(self.ocp.has_free_time)]
        return ConstraintRow(
            f"bound of {(*names, *self.ocp.model.u_names)[entry]}", "path", node, 0.0, 0.0
        )

    # -- costates -----------------------------------------------------------------------

    def costates(
        self, w: np.ndarray, lam_x: np.ndarray, lam_g: np.ndarray, data: RunData
    ) -> np.ndarray:
        """Return dJ*/dx at the nodes, (N + 1, nx), from the multipliers.

        At nodes 1..N minus the multiplier of the gap; at node 0 what balances the start. Of a
        start that is data the slope itself; entries of it that are not finite, where J* has no
        derivative, are replaced by those at node 1.
        """
        nx, initial = self.ocp.model.nx, self.ocp.at("initial")
        later = -lam_g[self._at("dynamics")].reshape(self.n, nx)
        first = -lam_x[:nx]
        if self.start_as_data:
            slope = self._start_slope(w, lam_g, data)
            return np.vstack([np.where(np.isfinite(slope), slope, later[0]), later])
        if initial:
            p = data.values.at(0.0)[0]
            first = (
                first
                - np.array(self.ocp.functions.initial_slope(w[:nx], data.t0, p)).T
                @ lam_g[self._at("initial")]
            )
        return np.vstack([first, later])

    def start_is_smooth(self, w: np.ndarray, data: RunData) -> bool:
        """Return whether the first stage has finite slopes in a fixed start."""
        if self.ocp.has_free_start:
            return True
        return bool(np.isfinite(self._start_slope(w, np.ones(len(self.rows)), data)).all())

    def _start_slope(self, w: np.ndarray, lam_g: np.ndarray, data: RunData) -> np.ndarray:
        """Derivative of the Lagrangian in x_0, (nx,)."""
        left, right = data.values.on(self.fractions)
        u, h = self.split(w)[1][0], self.duration(w) * node_widths(self.fractions)[0]
        of_after = -lam_g[self._at("dynamics")][: self.ocp.model.nx]
        of_path = lam_g[self._at("path")][: len(self.ocp.rows.path.rows)]
        value = self._start_slope_function(
            data.x0, u, data.t0, h, left[0], right[0], of_after, of_path
        )
        return np.array(value).ravel()

    @cached_property
    def _start_slope_function(self) -> ca.Function:
        return start_slope(self.ocp, self.integrator)

    # -- pieces ---------------------------------------------------------------------------

    def _at(self, place: str) -> np.ndarray:
        return self._places[place]

    @cached_property
    def _places(self) -> dict[str, np.ndarray]:
        """Which rows are of a place, bool (m,)."""
        places = np.array([row.place for row in self.rows])
        return {place: places == place for place in ("dynamics", "path", "initial")}

    @cached_property
    def last_rows(self) -> ConstraintRows:
        """What holds at the last node: path constraints without a control, and the end's own."""
        rows = self.ocp.rows
        return rows.path.where(~rows.path.on_control) + rows.terminal

    @cached_property
    def last(self) -> ca.Function:
        """Those rows as a Function of (x, t, p)."""
        m = self.ocp.model
        return ca.Function("last", [m.x, m.t, self.ocp.p], [self.last_rows.expression])
