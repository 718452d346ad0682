"""The manifold of configurations that a problem's dynamics never leave, at one instant."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp import OCP, UnsupportedProblem
from solvers.indirect.reverse.periods import Periods
from solvers.tabular.columns import Columns

# Residual at which a configuration lies on the manifold, relative to 1 + its first residual.
_ON = 1e-12
_MOST_STEPS = 60
_SMALLEST_STEP = 1e-3
# A motion that changes the equations faster than this, relative, does not keep them.
_KEPT = 1e-8
_PROBES = 8


@dataclass(frozen=True, eq=False)
class Manifold:
    r"""The set :math:`c(x, t, p) = 0` at a fixed instant; for an arm r1(t) = f(theta).

    Attributes:
        name: of its equations.
        size: number of its equations, m.
        system: (x, t, p) -> c (m,) and the columns of c_x (m, nx) below it.
        periods: of the states.
        t: the instant [s].
        p: parameters at that instant.
    """

    name: str
    size: int
    system: Columns
    periods: Periods
    t: float
    p: np.ndarray

    @property
    def redundancy(self) -> int:
        """Its dimension, n - m1."""
        return len(self.periods.of_states) - self.size

    def linearised(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return c (K, m) and c_x (K, m, nx) at configurations (K, nx)."""
        nx, m = len(self.periods.of_states), self.size
        both = self.system([rows], [np.array([self.t]), self.p])
        return both[:, :m], both[:, m:].reshape(-1, nx, m).transpose(0, 2, 1)

    def tangent(self, x: np.ndarray) -> np.ndarray:
        """Return an orthonormal basis (nx, n - m1) of the directions that stay on it."""
        slope = self.linearised(x[None, :])[1][0]
        return np.linalg.svd(slope)[2][len(slope) :].T

    def projector(self, x: np.ndarray) -> np.ndarray:
        """Return N = E - c_x^# c_x (nx, nx) at a configuration."""
        basis = self.tangent(x)
        return basis @ basis.T

    def projected(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Move configurations onto the manifold by damped Gauss-Newton steps.

        Args:
            rows: (K, nx).

        Returns:
            where they end (K, nx), and which of them arrived, bool (K,).
        """
        x = np.array(rows, dtype=float)
        values, slopes = self.linearised(x)
        norms = np.linalg.norm(values, axis=1)
        goal, length = _ON * (1.0 + norms), np.ones(len(x))
        for _ in range(_MOST_STEPS):
            moving = np.flatnonzero((norms > goal) & (length >= _SMALLEST_STEP))
            if not moving.size:
                break
            trial = x[moving] - length[moving, None] * _shortest(slopes[moving], values[moving])
            value, slope = self.linearised(trial)
            norm = np.linalg.norm(value, axis=1)
            better = norm < norms[moving]
            taken, refused = moving[better], moving[~better]
            x[taken], values[taken], slopes[taken] = trial[better], value[better], slope[better]
            norms[taken], length[taken] = norm[better], np.minimum(1.0, 2.0 * length[taken])
            length[refused] /= 2.0
        # The last step may stall at rounding, just above the goal.
        return x, norms <= 1e3 * goal


def _shortest(slopes: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the shortest steps d (K, nx) with slope d = value."""
    return np.einsum("kij,kj->ki", np.linalg.pinv(slopes), values)


def redundant_by_one(manifold: "Manifold | InvariantManifold") -> None:
    """Refuse a manifold that is no curve.

    Raises:
        UnsupportedProblem: with its dimension.
    """
    if manifold.redundancy != 1:
        raise UnsupportedProblem(
            f"the self-motion of {manifold.name} has {manifold.redundancy} dimensions, only a "
            "curve can be traced: use ReverseShooting, which needs no trace"
        )


def out_of_reach(manifold: Manifold, rows: np.ndarray) -> str:
    """Say how near the nearest of some configurations comes to the manifold."""
    distance = np.linalg.norm(manifold.linearised(rows)[0], axis=1).min()
    return (
        f"no configuration meets {manifold.name} at t = {manifold.t:.4g} s: the target is out "
        f"of reach (the nearest that was found misses it by {distance:.3g})"
    )


@dataclass(frozen=True, eq=False)
class InvariantManifold:
    """What the exact dynamics of a problem keep: its invariants, checked.

    Attributes:
        name: of the equations.
        size: number of equations, m.
        system: (x, t, p) -> c, and the columns of c_x below it.
        periods: of the states.
    """

    name: str
    size: int
    system: Columns
    periods: Periods

    @classmethod
    def of(cls, ocp: OCP) -> "InvariantManifold":
        """Collect the equations: the invariants, or else the terminal constraints.

        Raises:
            UnsupportedProblem: if there are none, they leave no redundancy, the dynamics do
                not keep them, or a terminal constraint asks for more than they say.
        """
        m, terminal = ocp.model, ocp.at("terminal")
        given = ocp.invariants or terminal
        if not given:
            raise UnsupportedProblem(
                f"{ocp.name}: nothing says where the motion ends: declare what the dynamics keep "
                "(for an arm: the task error) as an invariant"
            )
        name = ", ".join(f"'{c.name}'" for c in given)
        lowers = [np.broadcast_to(np.asarray(c.lower, float), c.expression.shape[0]) for c in given]
        c = ca.vertcat(*[entry.expression for entry in given]) - ca.DM(np.concatenate(lowers))
        if c.numel() >= m.nx:
            raise UnsupportedProblem(
                f"{ocp.name}: {name} are {c.numel()} equations for {m.nx} states: no redundancy "
                "is left"
            )
        slope = ca.densify(ca.jacobian(c, m.x))
        both = ca.densify(ca.vertcat(c, ca.vec(slope)))
        system = Columns(ca.Function("manifold", [m.x, m.t, ocp.p], [both]), 1)
        kept = cls(name, c.numel(), system, Periods.of(ocp))
        kept._check(ocp, c, slope)
        return kept

    @property
    def redundancy(self) -> int:
        """Dimension of what is left free, n - m1."""
        return len(self.periods.of_states) - self.size

    def at(self, t: float, p: np.ndarray) -> Manifold:
        """Return the manifold at an instant."""
        return Manifold(self.name, self.size, self.system, self.periods, t, p)

    def _check(self, ocp: OCP, c: ca.SX, slope: ca.SX) -> None:
        """Probe that no control changes the equations where they hold."""
        m, values = ocp.model, ocp.parameter_values()
        change = ca.mtimes(slope, m.f) + ca.jacobian(c, m.t)
        rate = ca.Function("rate", [m.x, m.u, m.t, ocp.p], [change, m.f])
        rng = np.random.default_rng(0)
        probes = rng.uniform(0.0, 1.0, _PROBES)
        for share in probes:
            manifold = self.at(share * ocp.duration, values.at(share)[0])
            t, p = manifold.t, manifold.p
            x, arrived = manifold.projected(ocp.start() + rng.normal(size=(_PROBES, m.nx)))
            if not arrived.any():
                raise UnsupportedProblem(f"{ocp.name}: {out_of_reach(manifold, x)}")
            x = x[arrived]
            u = ocp.control_bounds.clip(rng.normal(size=m.nu))
            changed, speed = (np.array(a).ravel() for a in rate(x[0], u, t, p))
            if np.abs(changed).max() > _KEPT * (1.0 + np.abs(speed).max()):
                raise UnsupportedProblem(
                    f"{ocp.name}: the dynamics do not keep {self.name} at t = {t:.3g} s; a "
                    "reverse integration would leave it, and a multiplier would be unknown"
                )
        self._check_terminal(ocp, rng)

    def _check_terminal(self, ocp: OCP, rng: np.random.Generator) -> None:
        """Refuse a terminal constraint that says more than the manifold does."""
        if not ocp.invariants:
            return
        t, p = ocp.duration, ocp.parameter_values().at(1.0)[0]
        first = ocp.start() + rng.normal(size=(_PROBES, ocp.model.nx))
        rows, arrived = self.at(t, p).projected(first)
        for c in ocp.at("terminal"):
            value = ca.Function("value", [ocp.model.x, ocp.model.t, ocp.p], [c.expression])
            for row in rows[arrived]:
                values = np.array(value(row, t, p)).ravel()
                outside = np.maximum(np.asarray(c.lower) - values, values - np.asarray(c.upper))
                if outside.max() > _KEPT:
                    raise UnsupportedProblem(
                        f"{ocp.name}: the terminal constraint '{c.name}' asks for more than "
                        f"{self.name}: its multiplier would be unknown; use IndirectShooting"
                    )
