"""How fast the controls of a solution change, and what that costs."""

from math import comb

import numpy as np

from ocp.normal_form.normal_form import normal_form
from ocp.problem.scaled import sizes_of
from ocp.solution.piecewise_polynomial import PiecewisePolynomial
from ocp.solution.solution import Solution

# Values that differ by less, relative to the size of u, are the same: no jump.
_ROUNDING = 1e-9


def rates_along(solution: Solution, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rates of the controls that have a ``Rate``, (K, m), and when (K,).

    In discrete time the changes at every step. In continuous time du/dt at the instants t [s] and
    where pieces meet; infinite where a control jumps, as a held one does from node to node.
    """
    if solution.problem.model.is_discrete:
        return _changes(solution), solution.t[:-1]
    jumps, when = _jumps(solution)
    if solution.control_kind == "extremal":
        return np.vstack([jumps, _of_extremal(solution, t)]), np.append(when, t)
    pieces = _derivative(solution)
    # The piece that ends at an instant, and the one that goes on from there.
    before = pieces.of(t - 2 * _ROUNDING * solution.duration)
    sides = [pieces.at(t, before), pieces.at(t)]
    return np.vstack([jumps, *sides]), np.concatenate([when, t, t])


def limited_rates(solution: Solution, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return ``rates_along`` for their bounds: a jump where there is no bound violates none."""
    values, when = rates_along(solution, t)
    box = solution.problem.control_rates.box
    unlimited = np.isinf(values) & ((values == box.lower) | (values == box.upper))
    return np.where(unlimited, box.clip(np.zeros(values.shape[1])), values), when


def price_of_rates(solution: Solution) -> float:
    """Return what the rates of the controls cost; 0 of an extremal, whose law has it in its cost.

    Exact, since the controls are polynomials; infinite where one with a weight jumps.
    """
    weight = solution.problem.control_rates.weight
    if not weight.any() or solution.control_kind == "extremal":
        return 0.0
    if solution.problem.model.is_discrete:
        return float((_changes(solution) ** 2 @ weight).sum())
    if (_jumps(solution)[0] != 0.0)[:, weight > 0.0].any():
        return np.inf
    pieces = _derivative(solution)
    squares = np.einsum("kin,ij,kjn->kn", *_with_gram(pieces.coefficients))
    return float(np.diff(pieces.edges) @ squares @ weight)


def _changes(solution: Solution) -> np.ndarray:
    """Return the changes of the controls at every step, (N, m)."""
    u = solution.u[:, solution.problem.control_rates.index]
    return np.diff(u, axis=0, prepend=_last_input(solution, u[0])[None, :])


def _last_input(solution: Solution, first: np.ndarray) -> np.ndarray:
    """Return what the controls were before the start; where that is free, what they are first."""
    last = solution.data.values.named("last_input")
    return first if last is None else last


def _pieces(solution: Solution) -> PiecewisePolynomial:
    """Return the controls that have a rate as polynomials."""
    index, u = solution.problem.control_rates.index, solution.u
    if solution.control_kind == "polynomial":
        own = solution.pieces
        return PiecewisePolynomial(own.edges, own.coefficients[:, :, index])
    rows = [u] if solution.control_kind == "held" else [u[:-1], u[1:]]
    return PiecewisePolynomial(solution.t, np.stack(rows, axis=1)[:, :, index])


def _derivative(solution: Solution) -> PiecewisePolynomial:
    """Return the rates as polynomials, of one degree less."""
    pieces = _pieces(solution)
    c, widths = pieces.coefficients, np.diff(pieces.edges)[:, None, None]
    if c.shape[1] == 1:
        return PiecewisePolynomial(pieces.edges, np.zeros_like(c))
    return PiecewisePolynomial(pieces.edges, (c.shape[1] - 1) * np.diff(c, axis=1) / widths)


def _jumps(solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Return rates at the start and between pieces, (K, m), and when: infinite at a jump, else 0.

    Where nothing jumps that is a rate that each has at some instant, or a smaller one.
    """
    if solution.control_kind == "extremal":
        when = solution.t[:1]
        after = solution.u[:1, solution.problem.control_rates.index]
        before = _last_input(solution, after[0])[None, :]
    else:
        pieces = _pieces(solution)
        when, after = pieces.edges[:-1], pieces.coefficients[:, 0]
        first = _last_input(solution, after[0])
        before = np.vstack([first, pieces.coefficients[:-1, -1]])
    step = after - before
    size = sizes_of(solution.problem).u[solution.problem.control_rates.index]
    is_jump = np.abs(step) > _ROUNDING * (size + np.abs(after))
    return np.where(is_jump, np.copysign(np.inf, step), 0.0), when


def _of_extremal(solution: Solution, t: np.ndarray) -> np.ndarray:
    """Return the rates along an extremal, which are controls of its normal form."""
    form = normal_form(solution.problem)
    if form is None or solution.normal is None:
        return np.zeros((len(t), 0))
    return solution.normal.control(t)[:, form.rates]


def _with_gram(c: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return coefficients on both sides of the integrals of products of the Bernstein basis."""
    p = c.shape[1] - 1
    each = range(p + 1)
    rows = [[comb(p, i) * comb(p, j) / comb(2 * p, i + j) for j in each] for i in each]
    return c, np.array(rows) / (2 * p + 1), c
