"""First guesses that go round what is in the way of the straight line."""

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, Box, Constraint, Guess, ProblemError
from ocp.internal import check_instance, check_numbers, check_positive, check_whole

# Instants at which a guess is looked at.
_SAMPLES = 41
# Guesses whose via-points are nearer than this part of the spread are the same way round.
_APART = 0.5
# What a guess may violate and still be clear, relative to the worst one: rounding.
_CLEAR = 1e-9


def via_point_guesses(
    ocp: OCP,
    goal: ArrayLike,
    number: int,
    seed: int,
    *,
    moving: Sequence[int | str] | None = None,
    spread: float | None = None,
    candidates: int = 200,
) -> list[Guess]:
    r"""Return guesses that pass a random point on their way from the start to a goal, best first.

    .. math::

        x(s) = x_0 + \sigma(s) (x_g - x_0) + \sin^2(\pi s)\, z, \quad
        \sigma = 3 s^2 - 2 s^3, \; s \in [0, 1]

    z is drawn for each candidate. The candidates are ordered by how much they violate the path
    constraints without controls and the state bounds, integrated along them, then by their
    length. The straight line z = 0 is one of them. Give them to ``multistart(guesses=...)``.

    Args:
        ocp: the problem.
        goal: the state at the end (nx,).
        number: how many, at most: of those that go the same way round only the best is kept.
        seed: the same seed gives the same guesses.
        moving: indices or names of the states that z changes, such as positions; None: those on
            which the path constraints without controls depend.
        spread: standard deviation of z in each of them; None: half the distance from start to goal.
        candidates: how many are drawn.

    Raises:
        ProblemError: naming what is wrong with a number, or a state that does not exist.
    """
    check_instance(ocp, OCP, "via points: the problem")
    check_whole(number, "via points: number")
    check_whole(seed, "via points: seed", least=0)
    check_whole(candidates, "via points: candidates", least=number)
    start = ocp.start()
    end = check_numbers(goal, ocp.model.nx, "via points: goal", repeat=False)
    chosen = _indices(ocp, moving)
    half = float(np.linalg.norm((end - start)[chosen])) / 2.0
    width = check_positive(half if spread is None else spread, "via points: spread")
    s = np.linspace(0.0, 1.0, _SAMPLES)
    drawn = np.random.default_rng(seed).normal(size=(candidates, len(chosen))) * width
    drawn[0] = 0.0
    bumps = np.zeros((candidates, ocp.model.nx))
    bumps[:, chosen] = drawn
    line = start + np.outer(3 * s**2 - 2 * s**3, end - start)
    paths = line + np.sin(np.pi * s)[None, :, None] ** 2 * bumps[:, None, :]
    lengths = np.linalg.norm(np.diff(paths[..., chosen], axis=1), axis=2).sum(axis=1)
    violations = _violations(ocp, paths, s)
    clear = violations <= _CLEAR * max(1.0, violations.max(initial=0.0))
    order = np.lexsort((lengths, np.where(clear, 0.0, violations)))
    kept: list[int] = []
    for k in order.tolist():
        if all(np.linalg.norm(drawn[k] - drawn[i]) > _APART * width for i in kept):
            kept.append(k)
    return [Guess(x=paths[k]) for k in kept[:number]]


def _indices(ocp: OCP, moving: Sequence[int | str] | None) -> list[int]:
    """Return the numbers of the states that move."""
    if moving is None:
        slopes = ca.jacobian(_rows(ocp), ocp.model.x).sparsity()
        found = sorted(set(slopes.get_col()))
    else:
        names = list(ocp.model.x_names)
        unknown = [m for m in moving if m not in (*names, *range(ocp.model.nx))]
        if unknown:
            raise ProblemError(
                f"via points: moving: there is no state {unknown[0]!r}; the states are "
                f"{', '.join(names)}"
            )
        found = [names.index(m) if isinstance(m, str) else int(m) for m in moving]
    if not found:
        raise ProblemError(
            "via points: no path constraint without controls depends on a state; say which "
            "states move, as in moving=(0, 1)"
        )
    return found


def _avoided(ocp: OCP) -> list[Constraint]:
    """Return the path constraints without controls."""
    return [c for c in ocp.at("path") if not ca.depends_on(c.expression, ocp.model.u)]


def _rows(ocp: OCP) -> ca.SX:
    return ca.vertcat(ca.SX(0, 1), *[c.expression for c in _avoided(ocp)])


def _violations(ocp: OCP, paths: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Return how much each path (k, n, nx) violates what has no control in it, on average."""
    m, count = ocp.model, paths.shape[0] * len(s)
    states = paths.reshape(count, -1)
    total = _outside(states, ocp.state_bounds).sum(axis=1)
    if avoided := _avoided(ocp):
        duration = float(ocp.horizon) if isinstance(ocp.horizon, int | float) else 1.0
        times = np.tile(s * duration, len(paths))
        parameters = np.tile(ocp.parameter_values().at(s), (len(paths), 1))
        rows = ca.Function("rows", [m.x, m.t, ocp.p], [ca.densify(_rows(ocp))]).map(count)
        values = np.array(rows(states.T, times[None, :], parameters.T)).T
        bounds = Box(*[np.concatenate(side) for side in zip(*map(_sides, avoided), strict=True)])
        total = total + _outside(values, bounds).sum(axis=1)
    return np.nan_to_num(total.reshape(len(paths), -1).mean(axis=1), nan=np.inf)


def _sides(c: Constraint) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(c.lower), np.asarray(c.upper)


def _outside(values: np.ndarray, box: Box) -> np.ndarray:
    """Return how far values (k, n) are outside of a box."""
    lower, upper = np.asarray(box.lower), np.asarray(box.upper)
    return np.maximum(0.0, np.maximum(lower - values, values - upper))
