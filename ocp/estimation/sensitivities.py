r"""How the residuals of data change with unknown constants and free starts.

Along the trajectory of the referee, with its controls held as they are,

.. math:: S_{k+1} = F_x S_k + F_\theta, \quad S_0 = x_\theta(t_0), \qquad
          r_\theta = (h_x S + h_\theta) / \sigma

with the exact derivatives of its steps F.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks.errors import UnsupportedProblem
from ocp.checks.expressions import element_names
from ocp.integration.one_step import RK4, Stage
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Unknown
from ocp.problem.scaled import sizes_of
from ocp.referee.evaluate import evaluate
from ocp.referee.reference_trajectory import ReferenceTrajectory
from ocp.solution.solution import Solution

# A constant this near to its bound, relative to its size, is held by it.
_HELD = 1e-6


@dataclass(frozen=True, eq=False)
class Estimated:
    """The constants and starts that the optimiser chose, and which of them a bound holds.

    Attributes:
        names: of all of them, starts as ``x(t0)`` of a state x, (n,).
        values: (n,).
        is_held: whether a bound holds one, bool (n,).
        in_p: where the constants, which come first, stand among the parameters.
        starts: which states have a free start.
    """

    names: tuple[str, ...]
    values: np.ndarray
    is_held: np.ndarray
    in_p: list[int]
    starts: list[int]

    @classmethod
    def of(cls, solution: Solution) -> "Estimated":
        """Read them off a solution."""
        ocp, first = solution.problem, 0
        names, in_p, starts = [], [], np.flatnonzero(ocp.start_is_free).tolist()
        for entry in ocp.entries:
            size = entry.symbol.numel()
            if isinstance(entry, Unknown):
                names += element_names(entry.symbol)
                in_p += range(first, first + size)
            first += size
        names += [f"{ocp.model.x_names[i]}(t0)" for i in starts]
        chosen = [np.ravel(solution.unknowns[e.name]) for e in ocp.unknowns]
        values = np.concatenate([np.zeros(0), *chosen, solution.x[0, starts]])
        boxes = [*[e.box for e in ocp.unknowns], ocp.start_box]
        lower, upper = (
            np.concatenate([*[np.ravel(b) for b in each[:-1]], np.asarray(each[-1])[starts]])
            for each in ([b.lower for b in boxes], [b.upper for b in boxes])
        )
        sizes = np.concatenate([*[e.size for e in ocp.unknowns], sizes_of(ocp).x[starts]])
        near = _HELD * np.maximum(np.abs(values), sizes)
        is_held = (values - lower <= near) | (upper - values <= near)
        return cls(tuple(names), values, is_held, in_p, starts)


def residual_slopes(solution: Solution, estimated: Estimated) -> tuple[np.ndarray, np.ndarray]:
    """Return all residuals that there are (M,), and their derivatives in what was chosen (M, n).

    Raises:
        UnsupportedProblem: where explicit steps do not follow the dynamics.
    """
    ocp = solution.problem
    truth = evaluate(solution).truth
    if not truth.has_adjoint:
        raise UnsupportedProblem(
            f"{ocp.name}: estimate: the dynamics are too stiff or too unstable for explicit steps, "
            "along which the data's sensitivities are integrated"
        )
    slopes, values = _along(ocp, truth, estimated), solution.data.values
    read = _readings(ocp, estimated)
    residuals, rows, first = [], [], 0
    for m in ocp.data:
        columns = slice(first, first + m.size)
        for i, time in enumerate(np.asarray(m.times)):
            k = int(np.abs(truth.t - truth.t[0] - time).argmin())
            p = values.at(min(1.0, time / ocp.duration))[0]
            h, h_x, h_theta = (np.array(v) for v in read(truth.x[k], truth.t[k], p))
            y, sigma = np.asarray(m.values)[i], np.asarray(m.sigma)[i]
            known = np.isfinite(y)
            slope = (h_x @ slopes[k] + h_theta)[columns]
            rows.append((slope / sigma[:, None])[known])
            residuals.append(((h.ravel()[columns] - y) / sigma)[known])
        first += m.size
    return np.concatenate(residuals), np.vstack(rows)


def _along(ocp: OCP, truth: ReferenceTrajectory, estimated: Estimated) -> np.ndarray:
    """Return the derivatives of the states at every step's start and the end, (K + 1, nx, n)."""
    nx, count, steps = ocp.model.nx, len(estimated.names), len(truth.t) - 1
    stage = Stage.of(ocp, RK4(), held=False).step
    s = [ca.SX.sym(stage.name_in(i), stage.sparsity_in(i)) for i in range(stage.n_in())]
    after = stage.call(s)[0]
    x, p0, p1 = s[0], s[-2], s[-1]
    in_theta = ca.jacobian(after, p0) + ca.jacobian(after, p1)
    outputs = [ca.densify(each) for each in (ca.jacobian(after, x), in_theta[:, estimated.in_p])]
    each = ca.Function("slopes", s, outputs).map(steps)
    h = np.diff(truth.t)
    given = (truth.x[:-1], truth.u_start, truth.u_end, truth.t[:-1], h, truth.p_start, truth.p_end)
    in_x, in_theta = (np.array(v) for v in each(*[np.atleast_2d(g.T) for g in given]))
    in_x = in_x.reshape(nx, steps, nx).swapaxes(0, 1)
    in_theta = in_theta.reshape(nx, steps, -1).swapaxes(0, 1)
    found = np.zeros((steps + 1, nx, count))
    constants = len(estimated.in_p)
    found[0, estimated.starts, np.arange(constants, count)] = 1.0
    for k in range(steps):
        found[k + 1] = in_x[k] @ found[k]
        found[k + 1, :, :constants] += in_theta[k]
    return found


def _readings(ocp: OCP, estimated: Estimated) -> ca.Function:
    """Return (x, t, p) -> what is measured, and its derivatives in x and in what was chosen."""
    m, p = ocp.model, ocp.p
    h = ocp.functions.measured(m.x, m.t, p)
    in_theta = ca.jacobian(h, p)[:, estimated.in_p]
    in_theta = ca.horzcat(in_theta, ca.SX(h.numel(), len(estimated.starts)))
    outputs = [ca.densify(each) for each in (h, ca.jacobian(h, m.x), in_theta)]
    return ca.Function("readings", [m.x, m.t, p], outputs)
