"""A task of a kinematic controller: a value, and the velocity that is wanted of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp import ProblemError
from ocp.internal import Portable

Expression = ca.SX | ArrayLike


@dataclass(frozen=True, eq=False, kw_only=True)
class Task(Portable):
    r"""Manipulation variables r = f(q, t) and the velocity that is wanted of them.

    .. math:: J \dot q = \dot r - \frac{\partial f}{\partial t}, \qquad
              J = \frac{\partial f}{\partial q}

    ``track``, ``repel`` and ``descend`` make the usual ones. Source: thesis (3.3), (3.4).

    Args:
        name: what messages call it.
        q: symbols of the joint angles, an ``SX`` column (n,) [rad], shared by all tasks.
        t: symbol of time [s], shared by all tasks.
        value: f(q, t), (m,), m <= n.
        rate: the velocity wanted of it, dr/dt (m,), an expression in q and t.
        error: how far the task is from done, an expression; empty where it has no target.
        activation: between 0 (the task does not exist) and 1, a scalar expression: the
            homogeneous term gain of (3.16).
        may_conflict: whether the rows may contradict those of higher tasks. Otherwise that is an
            error in the description.

    Raises:
        ProblemError: naming the task, on shapes that do not fit, more rows than joints, or
            symbols that are neither q nor t.
    """

    name: str
    q: ca.SX
    t: ca.SX
    value: ca.SX
    rate: ca.SX
    error: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    activation: ca.SX = field(default_factory=lambda: ca.SX(1))
    may_conflict: bool = False

    def __post_init__(self) -> None:
        """Check shapes and symbols."""
        _require_symbols(self.name, self.q, self.t)
        for part in ("value", "rate", "error", "activation"):
            what = f"task '{self.name}': {part}"
            expression = as_column(getattr(self, part), what)
            self._refuse_foreign_symbols(expression, what)
            object.__setattr__(self, part, expression)
        n = self.q.numel()
        if not 0 < self.rows <= n:
            raise ProblemError(
                f"task '{self.name}': {self.rows} rows, more than none and not more than the "
                f"{n} joints are needed"
            )
        if self.rate.numel() != self.rows or self.activation.numel() != 1:
            raise ProblemError(
                f"task '{self.name}': the rate has {self.rate.numel()} rows for "
                f"{self.rows} values, the activation {self.activation.numel()}, 1 "
                "is needed"
            )

    @property
    def rows(self) -> int:
        """Number of rows m."""
        return self.value.numel()

    @property
    def jacobian(self) -> ca.SX:
        """J (m, n), symbolic."""
        return ca.densify(ca.jacobian(self.value, self.q))

    @property
    def desired_velocity(self) -> ca.SX:
        """J dq/dt (m,): the desired velocity without that of time alone."""
        return ca.densify(self.rate - ca.jacobian(self.value, self.t))

    @property
    def has_target(self) -> bool:
        """Whether it is known how far the task is from done."""
        return bool(self.error.numel())

    @property
    def is_rigid(self) -> bool:
        """Whether the task is always on and contradicts no other."""
        on = self.activation
        return not self.may_conflict and on.is_constant() and float(on) == 1.0

    def _refuse_foreign_symbols(self, expression: ca.SX, what: str) -> None:
        known = {s.element_hash() for s in ca.vertsplit(ca.vertcat(self.q, self.t))}
        foreign = [str(s) for s in ca.symvar(expression) if s.element_hash() not in known]
        if foreign:
            raise ProblemError(f"{what} contains {', '.join(foreign)}, neither q nor t")


def track(
    name: str,
    *,
    q: ca.SX,
    t: ca.SX,
    value: Expression,
    desired: Expression,
    gain: ArrayLike = 0.0,
    angular: bool | Sequence[bool] = False,
) -> Task:
    r"""Return the task of following a path, with feedback (closed-loop inverse kinematics).

    .. math:: \dot r = \dot r_d + K (r_d - r)

    Source: thesis (3.18), (3.19), for positions and orientations (3.30).

    Args:
        name: what messages call it.
        q: joint angles (n,) [rad].
        t: time [s].
        value: r(q, t), (m,) [m] or [rad].
        desired: r_d(t), (m,).
        gain: K [1/s], a number, (m,), or (m, m); 0: an error stays.
        angular: which rows are angles: their error is taken the short way round.

    Raises:
        ProblemError: on shapes that do not fit or a gain that is not finite or negative.
    """
    _require_symbols(name, q, t)
    r, target = as_column(value, f"task '{name}': value"), as_column(desired, f"task '{name}'")
    if r.numel() != target.numel():
        raise ProblemError(f"task '{name}': {r.numel()} values, {target.numel()} desired ones")
    error, m = target - r, r.numel()
    if np.size(angular) not in (1, m):
        raise ProblemError(f"task '{name}': angular has {np.size(angular)} entries, {m} needed")
    turns = np.broadcast_to(np.asarray(angular, dtype=bool).reshape(-1), m)
    short = ca.atan2(ca.sin(error), ca.cos(error))
    error = ca.vertcat(*[short[i] if turns[i] else error[i] for i in range(m)])
    rate = ca.jacobian(target, t) + ca.mtimes(ca.DM(_gain(gain, m, name)), error)
    return Task(name=name, q=q, t=t, value=r, rate=rate, error=error)


def descend(name: str, *, q: ca.SX, t: ca.SX, potential: ca.SX, gain: float) -> Task:
    r"""Return the task of making a potential smaller, as far as higher tasks let it.

    .. math:: \dot q = -k \nabla H(q, t)

    Joint limits and dexterity are such potentials. It may_conflict: its n rows contradict those
    of every higher task, which then win. Source: thesis (3.5) with y = -k ∇H; [Liegeois 1977].

    Args:
        name: what messages call it.
        q: joint angles (n,) [rad].
        t: time [s].
        potential: H, a scalar expression with a gradient at every configuration.
        gain: k [1/s for a potential in rad²], not negative.

    Raises:
        ProblemError: on a potential that is no scalar, or a bad gain.
    """
    _require_symbols(name, q, t)
    slope = as_column(potential, f"task '{name}': potential")
    if slope.numel() != 1:
        raise ProblemError(f"task '{name}': potential has {slope.numel()} entries, 1 is needed")
    k = float(_gain(gain, 1, name)[0, 0])
    return Task(name=name, q=q, t=t, value=q, rate=-k * ca.gradient(slope, q), may_conflict=True)


def _require_symbols(name: str, q: ca.SX, t: ca.SX) -> None:
    for symbols, what in ((q, "q"), (t, "t")):
        if not isinstance(symbols, ca.SX) or not symbols.is_valid_input():
            raise ProblemError(f"task '{name}': {what} is no column of SX symbols")


def as_column(expression: Expression, what: str) -> ca.SX:
    """Return an expression or numbers as a dense ``SX`` column."""
    try:
        result = expression if isinstance(expression, ca.SX) else ca.SX(ca.DM(np.array(expression)))
    except (TypeError, ValueError, NotImplementedError) as error:
        kind = type(expression).__name__
        raise ProblemError(f"{what} is a {kind}, neither an SX expression nor numbers") from error
    if 1 not in result.shape and result.numel():
        raise ProblemError(f"{what} has shape {result.shape}, a column is needed")
    return ca.densify(ca.vec(result))


def _gain(gain: ArrayLike, m: int, name: str) -> np.ndarray:
    """Return K (m, m)."""
    try:
        k = np.array(gain, dtype=float)
    except (TypeError, ValueError) as error:
        raise ProblemError(f"task '{name}': gain is not numeric: {gain!r}") from error
    if k.shape not in ((), (m,), (m, m)):
        raise ProblemError(f"task '{name}': gain has shape {k.shape}, (), ({m},) or ({m}, {m})")
    matrix = k if k.ndim == 2 else np.diag(np.broadcast_to(k, m))
    if not np.isfinite(matrix).all() or (np.diag(matrix) < 0.0).any():
        raise ProblemError(f"task '{name}': gain = {gain}, it must be finite and not negative")
    return matrix
