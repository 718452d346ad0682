"""The optimality conditions of the problem on a grid, by linear algebra of its own."""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy.linalg import null_space
from scipy.optimize import lsq_linear

from ocp import RK4, Solution
from ocp.internal import Transcription, sizes_of, without_traces
from solvers.certify.certificate import Check, Verdict

# A bound this close, relative to its size and the typical one, is taken as active.
_ACTIVE = 1e-5
# Singular values below this share of the largest count as zero.
_DEPENDENT = 1e-9
# Of the gradient of the Lagrangian and of multipliers of the wrong sign, relative to the
# largest entry of the cost's gradient and 1, in typical sizes.
_RESIDUAL = 1e-5
# A multiplier this small, by the same measure, does not hold an inequality at its bound.
_WEAK = 1e-5
# Of the Lagrangian's eigenvalues on the null space, relative to its largest entry.
_CURVED = 1e-7
# Steps that the fit of multipliers with signs may take for each row.
_ROWS = 10

INDEPENDENCE, STATIONARITY, CURVATURE = "LICQ", "multipliers", "curvature on the grid"
CHECKS = INDEPENDENCE, STATIONARITY, CURVATURE


@dataclass(frozen=True, eq=False)
class _Point:
    """The program at one point, with unknowns and cost in typical sizes, so that no unit decides.

    Attributes:
        slope: gradient of the cost.
        rows: gradients of the active constraints and bounds, of length one.
        signs: 1 where the multiplier may not be negative, -1 where not positive, else 0.
        names: what each active row says.
        multipliers: that fit the slope best; with no regard to signs where the rows are
            independent, since they are unique there.
        hessian: of the Lagrangian with these multipliers.
    """

    slope: np.ndarray
    rows: np.ndarray
    signs: np.ndarray
    names: tuple[str, ...]
    multipliers: np.ndarray
    hessian: np.ndarray


def grid_checks(solution: Solution, integrator: RK4 | None = None) -> tuple[Check, ...]:
    r"""Check the Karush-Kuhn-Tucker conditions on a solution's own grid.

    The multipliers of the rows that are active are fitted anew, so that nothing is taken over
    from the solver:

    .. math:: \min_\lambda \| f_w + J_A' \lambda \|_2

    Three checks come of it: the gradients of the active rows are independent (LICQ); the
    residual vanishes, with multipliers of the right signs; the Hessian of the Lagrangian is not
    negative on the null space of the active rows. Where it is negative once the inequalities
    without a multiplier are let go, it decides nothing, and the third check counts as not made.
    Where LICQ fails the multipliers are not unique and neither is that Hessian: at an optimum
    then some of them make it not negative, not all, and the third check disproves nothing.

    Args:
        solution: of direct multiple shooting, controls held.
        integrator: of its intervals, default RK4.
    """
    ocp, nodes = solution.problem, solution.fractions
    method = integrator or RK4()
    transcription = Transcription(ocp, len(nodes) - 1, method, nodes=nodes)
    point = _point(transcription, solution)
    independence, curvature = _independence(point), _curvature(point)
    if independence.verdict is not Verdict.HOLDS:
        said = f"{curvature.sentence}; of one of many sets of multipliers, which decides nothing"
        curvature = replace(curvature, sentence=said, decisive=False)
    return independence, _stationarity(point), curvature


def _point(transcription: Transcription, solution: Solution) -> _Point:
    data = solution.data
    w = transcription.iterate(solution.x, solution.u, solution.duration)
    if not transcription.start_is_smooth(w, data):
        transcription = replace(transcription, start_as_data=True)
    p = transcription.data_vector(data)
    program, bounds = transcription.program, transcription.bounds(data)
    weights = ca.MX.sym("weights", program["g"].numel())
    unknowns, given = program["x"], program["p"]
    first = ca.Function(
        "first",
        [unknowns, given],
        [program["g"], ca.gradient(program["f"], unknowns), ca.jacobian(program["g"], unknowns)],
    )
    lagrangian = program["f"] + ca.dot(weights, program["g"])
    second = ca.Function(
        "second", [unknowns, given, weights], [ca.hessian(lagrangian, unknowns)[0]]
    )
    unit, cost = _sizes(transcription, solution)
    g, slope, jacobian = (np.array(a) for a in first(w, p))
    jacobian = without_traces(jacobian) * unit
    in_g, signs_g = _active(g.ravel(), bounds["lbg"], bounds["ubg"], _lengths(jacobian))
    in_w, signs_w = _active(w, bounds["lbx"], bounds["ubx"], unit)
    lengths = _lengths(jacobian[in_g])
    rows = np.vstack([jacobian[in_g] / lengths[:, None], np.eye(len(w))[in_w]])
    signs = np.concatenate([signs_g[in_g], signs_w[in_w]])
    slope = slope.ravel() * unit / cost
    multipliers = _fitted(rows, signs, slope)
    of_g = np.zeros(len(g))
    of_g[in_g] = multipliers[: in_g.sum()] * cost / lengths
    names = [
        _of_row(row.name, row.node) for row, on in zip(transcription.rows, in_g, strict=True) if on
    ]
    names += [_of_unknown(transcription, int(i)) for i in np.flatnonzero(in_w)]
    return _Point(
        slope=slope,
        rows=rows,
        signs=signs,
        names=tuple(names),
        multipliers=multipliers,
        hessian=np.array(second(w, p, of_g)) * unit * unit[:, None] / cost,
    )


def _sizes(transcription: Transcription, solution: Solution) -> tuple[np.ndarray, float]:
    """Return typical sizes of all unknowns, and of the cost."""
    sizes = sizes_of(transcription.ocp)
    x, u = (
        np.tile(size, (len(of), 1)) for size, of in ((sizes.x, solution.x), (sizes.u, solution.u))
    )
    return transcription.iterate(x, u, solution.duration), sizes.cost


def _lengths(rows: np.ndarray) -> np.ndarray:
    """Return the lengths of rows; of those that vanish 1."""
    lengths = np.linalg.norm(rows, axis=1)
    return np.where(lengths > 0.0, lengths, 1.0)


def _fitted(rows: np.ndarray, signs: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Multipliers that balance the slope best.

    Where the rows depend on each other there are many: then some with the right signs are
    looked for, whose existence is what optimality asks.
    """
    free, _, rank, _ = np.linalg.lstsq(rows.T, -slope, rcond=_DEPENDENT)
    if rank == len(rows):
        return free
    least, most = np.where(signs > 0, 0.0, -np.inf), np.where(signs < 0, 0.0, np.inf)
    return lsq_linear(rows.T, -slope, (least, most), method="bvls", max_iter=_ROWS * len(rows)).x


def _active(
    value: np.ndarray, lower: np.ndarray, upper: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return which bounds are met with equality, and the sign of their multipliers."""
    with np.errstate(invalid="ignore"):
        at_lower = np.isfinite(lower) & (value - lower <= _ACTIVE * (size + np.abs(lower)))
        at_upper = np.isfinite(upper) & (upper - value <= _ACTIVE * (size + np.abs(upper)))
    is_equation = lower == upper
    at_lower, at_upper = at_lower | is_equation, at_upper | is_equation
    return at_lower | at_upper, at_upper.astype(int) - at_lower.astype(int)


def _of_row(name: str, node: int) -> str:
    return f"'{name}' at node {node}"


def _of_unknown(transcription: Transcription, index: int) -> str:
    """Name a bound of the unknowns."""
    m, stage = transcription.ocp.model, transcription.nz + transcription.ocp.model.nu
    names = [*m.x_names, *["final time"] * int(transcription.ocp.has_free_time), *m.u_names]
    return f"bound of {names[index % stage]} at node {index // stage}"


def _independence(point: _Point) -> Check:
    """LICQ."""
    rows, unknowns = point.rows.shape
    if rows > unknowns:
        return _dependent(f"{rows} active rows for {unknowns} unknowns", 0.0)
    is_zero = ~point.rows.any(axis=1)
    if is_zero.any():
        return _dependent(f"the gradient of {point.names[int(is_zero.argmax())]} vanishes", 0.0)
    values, turned = np.linalg.svd(point.rows.T, full_matrices=False)[1:]
    ratio = float(values[-1] / values[0])
    if ratio <= _DEPENDENT:
        name = point.names[int(np.abs(turned[-1]).argmax())]
        return _dependent(f"{name} depends on other active constraints", ratio)
    said = f"{rows} active rows, smallest singular value {ratio:.1e} of the largest"
    return Check(INDEPENDENCE, Verdict.HOLDS, said, ratio, _DEPENDENT, decisive=False)


def _dependent(why: str, ratio: float) -> Check:
    said = f"{why}: the multipliers are not unique, though the point may well be optimal"
    return Check(INDEPENDENCE, Verdict.FAILS, said, ratio, _DEPENDENT, decisive=False)


def _stationarity(point: _Point) -> Check:
    left = point.slope + point.rows.T @ point.multipliers
    wrong = np.maximum(0.0, -point.signs * point.multipliers) + 0.0  # no -0.0 in a sentence
    scale = max(1.0, float(np.abs(point.slope).max()))
    worst = max(float(np.abs(left).max()), float(wrong.max(initial=0.0))) / scale
    one_sided = int(np.count_nonzero(point.signs))
    said = (
        f"gradient of the Lagrangian {np.abs(left).max() / scale:.1e}, wrong signs "
        f"{wrong.max(initial=0.0) / scale:.1e} among {one_sided} inequalities"
    )
    if wrong.max(initial=0.0) / scale > _RESIDUAL:
        said += f"; {point.names[int(wrong.argmax())]} has a multiplier of the wrong sign"
    return Check.at_most(STATIONARITY, worst, _RESIDUAL, said)


def _curvature(point: _Point) -> Check:
    scale = max(1.0, float(np.abs(point.hessian).max()))
    least, size = _least_curvature(point, np.ones(len(point.rows), dtype=bool))
    if -least / scale <= _CURVED:
        weak = _weak(point)
        inside, _ = _least_curvature(point, ~weak)
        if -inside / scale > _CURVED:
            return Check.skipped(
                CURVATURE,
                f"smallest eigenvalue {inside:.1e} where {weak.sum()} inequalities that are met "
                "without a multiplier are let go: a minimum only if all such ways lead out",
            )
    if not size:
        return Check(CURVATURE, Verdict.HOLDS, "the active rows leave no freedom")
    said = f"smallest eigenvalue {least:.1e} in {size} free directions"
    if abs(least) <= _CURVED * scale:
        said += ": flat, the optimum need not be unique"
    return Check.at_most(CURVATURE, -least / scale, _CURVED, said)


def _weak(point: _Point) -> np.ndarray:
    """Which inequalities are active, but do not hold the optimum back."""
    scale = max(1.0, float(np.abs(point.slope).max()))
    return (point.signs != 0) & (np.abs(point.multipliers) <= _WEAK * scale)


def _least_curvature(point: _Point, kept: np.ndarray) -> tuple[float, int]:
    """The least eigenvalue on the null space of some rows, and the size of that space."""
    free = null_space(point.rows[kept], rcond=_DEPENDENT)
    if not free.shape[1]:
        return np.inf, 0
    reduced = free.T @ point.hessian @ free
    return float(np.linalg.eigvalsh((reduced + reduced.T) / 2.0)[0]), free.shape[1]
