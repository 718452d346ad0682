"""The C code of the native solver for one problem: its sizes and the functions of its nodes."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp import OCP, Integrator
from ocp.internal import (
    SAME_INSTANT,
    Stage,
    StageInputs,
    StageTape,
    Transcription,
    node_widths,
    sizes_of,
)
from solvers.direct.native.lane_code import lane_code
from solvers.direct.warm_start import UNCHANGED

#: Iterations of which something is noted.
NOTED = 512
_CORE = Path(__file__).with_name("core")
#: Files of the fixed part after the generated one, in the order in which the compiler reads them.
FILES = (
    "workspace",
    "evaluate",
    "frozen",
    "riccati",
    "barrier",
    "line_search",
    "solve",
    "warm_start",
    "account",
    "entry",
    "batch",
)

#: Iterations of which ``workspace.h`` notes something, and bytes of a note.
NOTED, NOTE_BYTES = 512, 56


@dataclass(frozen=True, eq=False)
class StageCode:
    r"""The nodes of a transcribed problem, as functions of w = (u, x) and of the data d of a node.

    .. math:: d = (t_0, \phi, \Delta\phi, p_0, p_1)

    with the node and the width of its interval as fractions of the horizon, and the parameters at
    both ends of the interval. A free final time is the last entry of x.

    Attributes:
        transcription: the problem on its grid.
    """

    transcription: Transcription

    # -- sizes -------------------------------------------------------------------------------

    @cached_property
    def nx(self) -> int:
        """States of a node, the final time included."""
        return self.transcription.nz

    @cached_property
    def nu(self) -> int:
        """Controls of a node."""
        return self.transcription.ocp.model.nu

    @cached_property
    def nd(self) -> int:
        """Data of a node."""
        return 3 + 2 * self.transcription.ocp.p.numel()

    @cached_property
    def row_counts(self) -> tuple[int, int, int]:
        """Rows of every stage, of the start alone, and of the end."""
        rows = self.transcription.ocp.rows
        return len(rows.path), len(rows.initial), len(self.transcription.last_rows)

    @cached_property
    def bounded(self) -> tuple[int, ...]:
        """Entries of w = (u, x) that have a bound at any node."""
        ocp = self.transcription.ocp
        boxes = [ocp.control_bounds, ocp.state_bounds]
        lower, upper = (
            np.concatenate([np.asarray(getattr(box, side), dtype=float) for box in boxes])
            for side in ("lower", "upper")
        )
        at_start = np.asarray(ocp.start_box.lower), np.asarray(ocp.start_box.upper)
        has = np.isfinite(lower) | np.isfinite(upper)
        has[self.nu :] |= np.isfinite(at_start[0]) | np.isfinite(at_start[1])
        time = [self.nu + ocp.model.nx] if ocp.has_free_time else []
        return (*np.flatnonzero(has).tolist(), *time)

    @cached_property
    def sizes(self) -> np.ndarray:
        """Of the states of a node, (nx,), which the accuracy of the integration is relative to."""
        time = [1.0] * (self.nx - self.transcription.ocp.model.nx)
        return np.append(sizes_of(self.transcription.ocp).x, time)

    # -- the functions of a node -------------------------------------------------------------

    @cached_property
    def functions(self) -> tuple[ca.Function, ...]:
        """Values, and values with derivatives: of a stage, of the start, of the end."""
        return (*self._stage(), self._half_step(), *self._start(), *self._end())

    def _half_step(self) -> ca.Function:
        """The next state with half the integration step; a discrete model has no other one."""
        tr, ocp, s = self.transcription, self.transcription.ocp, self._symbols
        finer = replace(tr.integrator, steps=2 * tr.integrator.steps)
        integrator = tr.integrator if ocp.model.is_discrete else finer
        given = [s.state, s.u, self._time, self._duration * s.width, s.left, s.right]
        after, _ = Stage.of(ocp, integrator, held=True).step.call(given)
        final_time = [s.x[ocp.model.nx]] if ocp.has_free_time else []
        return _function("stage_half", [s.x, s.u, s.d], [ca.vertcat(after, *final_time)])

    def _stage(self) -> tuple[ca.Function, ...]:
        tr, ocp, s = self.transcription, self.transcription.ocp, self._symbols
        h = self._duration * s.width
        given = [s.state, s.u, self._time, h, s.left, s.right]
        after, cost = Stage.of(ocp, tr.integrator, held=True).step.call(given)
        path = ocp.functions.path(s.state, s.u, self._time, s.left)
        final_time = [s.x[ocp.model.nx]] if ocp.has_free_time else []
        costate, y = ca.SX.sym("lambda", self.nx), ca.SX.sym("y", self.row_counts[0])
        # What the tape differentiates along, (x, u) or (x, u, t, h), as linear in w.
        inputs = ca.vertcat(*given[: 4 if ocp.has_free_time else 2])
        along = ca.jacobian(inputs, s.w)
        tape = _tape(ocp, tr.integrator).call([*given, costate[: ocp.model.nx]])
        end, end_cost, jacobian, gradient, hessian = tape
        slope = ca.vertcat(jacobian @ along, *[ca.jacobian(each, s.w) for each in final_time])
        c_slope, c_hessian = _derivatives(path, y, s.w)
        derivatives = [slope.T, (gradient @ along).T, c_slope.T]
        second = along.T @ hessian @ along + c_hessian
        arguments = [s.x, s.u, s.d]
        values = [ca.vertcat(after, *final_time), cost, path]
        first = [ca.vertcat(end, *final_time), end_cost, path, *derivatives]
        return (
            _function("stage_value", arguments, values),
            _function("stage_slope", [*arguments, costate, y], first),
            _function("stage_full", [*arguments, costate, y], [*first, second]),
        )

    def _start(self) -> tuple[ca.Function, ca.Function]:
        s, functions = self._symbols, self.transcription.ocp.functions
        rows = functions.initial(s.state, self._time, s.left)
        y = ca.SX.sym("y", rows.numel())
        slope, hessian = _derivatives(rows, y, s.w)
        return (
            _function("start_value", [s.x, s.d], [rows]),
            _function("start_full", [s.x, s.d, y], [rows, slope.T, hessian]),
        )

    def _end(self) -> tuple[ca.Function, ca.Function]:
        tr, s = self.transcription, self._symbols
        given = (s.state, self._time, s.left)
        cost, rows = tr.ocp.functions.terminal_cost(*given), tr.last(*given)
        y = ca.SX.sym("y", rows.numel())
        slope, hessian = _derivatives(rows, y, s.w)
        cost_hessian, gradient = ca.hessian(cost, s.w)
        full = [cost, rows, gradient, slope.T, hessian + cost_hessian]
        return (
            _function("end_value", [s.x, s.d], [cost, rows]),
            _function("end_full", [s.x, s.d, y], full),
        )

    # -- symbols -----------------------------------------------------------------------------

    @cached_property
    def _symbols(self) -> "_Symbols":
        return _Symbols.of(self.nx, self.nu, self.nd, self.transcription.ocp.model.nx)

    @property
    def _duration(self) -> ca.SX:
        """Final time minus t0 [s]."""
        ocp, s = self.transcription.ocp, self._symbols
        if not ocp.has_free_time:
            return ca.SX(ocp.duration)
        return self.transcription.time_unit * s.x[ocp.model.nx]

    @property
    def _time(self) -> ca.SX:
        """The instant of the node [s]."""
        return self._symbols.t0 + self._symbols.fraction * self._duration

    # -- the C code --------------------------------------------------------------------------

    @property
    def code(self) -> str:
        """The whole translation unit.

        Raises:
            UnsupportedProblem: for an operation that cannot be written so.
        """
        functions = lane_code(self.functions, self.transcription.ocp.name)
        return "\n".join([read("lanes"), self.sizes_code, functions, *map(read, FILES)])

    @property
    def sizes_code(self) -> str:
        """What ``workspace.h`` asks for."""
        nc, ni, ne = self.row_counts
        sizes = {"NX": self.nx, "NU": self.nu, "NW": self.nu + self.nx, "NB": len(self.bounded)}
        sizes |= {"NC": nc, "NI": ni, "NE": ne, "ND": self.nd}
        numbers = {"SAME_INSTANT": SAME_INSTANT, "UNCHANGED": UNCHANGED}
        lines = [f"#define {name} {value}" for name, value in (sizes | numbers).items()]
        lines += ["#ifndef NOTED", f"#define NOTED {NOTED}", "#endif"]  # a test notes fewer
        entries = ", ".join(map(str, self.bounded or (0,)))
        return "\n".join([*lines, f"static const int bounded[] = {{{entries}}};"])

    # -- the numbers of a run ----------------------------------------------------------------

    @cached_property
    def flat_size(self) -> int:
        """Length of the flat arrays: bounds and rows of all nodes."""
        return (self.transcription.n + 1) * len(self.bounded) + self.row_total

    @cached_property
    def row_total(self) -> int:
        """Rows of all nodes."""
        nc, ni, ne = self.row_counts
        return self.transcription.n * nc + ni + ne

    def data(self, p: np.ndarray) -> np.ndarray:
        """Return the data of all nodes, (N + 1, nd), of those of the program, ``data_vector``."""
        n, n_p = self.transcription.n, (self.nd - 3) // 2
        result, half = np.empty((n + 1, self.nd)), 3 + n_p
        result[:, 0], result[:, 1:3] = p[0], self.grid
        if n_p:
            left, right = p[1:].reshape(-1, n_p)[:n], p[1:].reshape(-1, n_p)[n : 2 * n]
            result[:n, 3:half], result[:n, half:] = left, right
            result[n, 3:half] = result[n, half:] = p[1:].reshape(-1, n_p)[2 * n]
        return result

    @property
    def has_parameters(self) -> bool:
        """Whether the data of a node are more than its times."""
        return self.nd > 3

    @cached_property
    def grid(self) -> np.ndarray:
        """Nodes and widths of the intervals after them as fractions of the horizon, (N + 1, 2)."""
        nodes = self.transcription.fractions
        return np.column_stack([nodes, np.append(node_widths(nodes), 0.0)])


class _Symbols(NamedTuple):
    """x with the final time, u, w = (u, x), the state alone, and d with its parts."""

    x: ca.SX
    u: ca.SX
    w: ca.SX
    state: ca.SX
    d: ca.SX
    t0: ca.SX
    fraction: ca.SX
    width: ca.SX
    left: ca.SX
    right: ca.SX

    @classmethod
    def of(cls, nx: int, nu: int, nd: int, states: int) -> "_Symbols":
        x, u, d = ca.SX.sym("x", nx), ca.SX.sym("u", nu), ca.SX.sym("d", nd)
        half = 3 + (nd - 3) // 2
        parts = (d[0], d[1], d[2], d[3:half], d[half:])
        return cls(x, u, ca.vertcat(u, x), x[:states], d, *parts)


def _tape(ocp: OCP, integrator: Integrator) -> ca.Function:
    """Return a stage with its derivatives, slope by slope, along (x, u), or along t and h too."""
    m, n_p = ocp.model, ocp.p.numel()
    sizes = {"x": m.nx, "u": m.nu, "t": 1, "h": 1, "p0": n_p, "p1": n_p}
    s = {name: ca.MX.sym(name, size) for name, size in sizes.items()}
    costate = ca.MX.sym("costate", m.nx)
    tape = StageTape.of(ocp, integrator, StageInputs(**s), timed=ocp.has_free_time)
    end = tape.end
    hessian = tape.hessian(costate, ca.MX(1))
    outputs = [end.x, end.cost, end.state_jacobian, end.cost_gradient, hessian]
    return ca.Function("tape", [*s.values(), costate], outputs)


def _derivatives(rows: ca.SX, y: ca.SX, w: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the slopes of rows, and the Hessian of y'rows."""
    hessian, _ = ca.hessian(ca.dot(y, rows), w)
    return ca.jacobian(rows, w), hessian


def _function(name: str, arguments: list[ca.SX], values: list[ca.SX]) -> ca.Function:
    return ca.Function(name, arguments, ca.cse([ca.densify(value) for value in values]))


def read(name: str) -> str:
    """Return a file of the fixed part."""
    return (_CORE / f"{name}.h").read_text(encoding="utf-8")
