"""First guesses that go round what is in the way of the straight line."""

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, Guess, ProblemError
from ocp.internal import check_instance, check_positive, check_whole

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
        moving: indices or names of the states that z changes, such as positions; None: those that
            differ between start and goal.
        spread: standard deviation of z in each of them; None: half the distance from start to goal.
        candidates: how many are drawn.

    Raises:
        ProblemError: naming what is wrong with a number, or a state that does not exist.
    """
    check_instance(ocp, OCP, "via points: the problem")
    check_whole(number, "via points: number")
    check_whole(seed, "via points: seed", least=0)
    check_whole(candidates, "via points: candidates", least=number)
    start, end = ocp.start(), _goal(ocp, goal)
    chosen = _indices(ocp, moving, end - start)
    width = float(np.linalg.norm((end - start)[chosen])) / 2.0 if spread is None else spread
    check_positive(width, "via points: spread")
    drawn = np.random.default_rng(seed).normal(size=(candidates, len(chosen))) * width
    drawn[0] = 0.0
    bumps = np.zeros((candidates, ocp.model.nx))
    bumps[:, chosen] = drawn
    s = np.linspace(0.0, 1.0, _SAMPLES)
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


def _goal(ocp: OCP, goal: ArrayLike) -> np.ndarray:
    found = np.asarray(goal, dtype=float).reshape(-1)
    if found.size != ocp.model.nx or not np.isfinite(found).all():
        raise ProblemError(
            f"via points: goal is {np.asarray(goal)}, {ocp.model.nx} finite numbers are needed, "
            f"one for each state of '{ocp.name}'"
        )
    return found


def _indices(ocp: OCP, moving: Sequence[int | str] | None, way: np.ndarray) -> list[int]:
    if moving is None:
        found = np.flatnonzero(way).tolist()
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
        raise ProblemError("via points: start and goal are the same; say which states move")
    return found


def _violations(ocp: OCP, paths: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Return how much each path (k, n, nx) violates what has no control in it, on average."""
    m = ocp.model
    rows = [c for c in ocp.at("path") if not ca.depends_on(c.expression, m.u)]
    values = ocp.parameter_values()
    duration = float(ocp.horizon) if isinstance(ocp.horizon, int | float) else 1.0
    total = _outside(paths, ocp.state_bounds.lower, ocp.state_bounds.upper).sum(axis=(1, 2))
    if rows:
        stacked = ca.vertcat(*[c.expression for c in rows])
        given = ca.Function("rows", [m.x, m.t, ocp.p], [ca.densify(stacked)])
        count = len(paths) * len(s)
        p = np.tile(values.at(s), (len(paths), 1))
        found = given.map(count)(
            paths.reshape(count, -1).T, np.tile(s * duration, len(paths))[None, :], p.T
        )
        bounds = [np.concatenate([np.asarray(b) for b in side]) for side in zip(*[(c.lower, c.upper) for c in rows], strict=True)]
        outside = _outside(np.array(found).T, *bounds)
        total = total + outside.reshape(len(paths), -1).sum(axis=1)
    return np.nan_to_num(total / len(s), nan=np.inf)


def _outside(values: np.ndarray, lower: ArrayLike, upper: ArrayLike) -> np.ndarray:
    return np.maximum(0.0, np.maximum(np.asarray(lower) - values, values - np.asarray(upper)))
