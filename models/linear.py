"""Linear plants and their quadratic problems: state space, transfer functions, references."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy import signal

from models._numbers import at_least, vector
from ocp import OCP, Box, Model, ProblemError, Signal

# More asymmetry of a weight than this, relative to its largest entry, is no slip of rounding.
_SYMMETRIC = 1e-12


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearPlant:
    r"""A linear time-invariant plant.

    .. math:: \dot x = Ax + Bu \quad (\text{dt is None}), \qquad x_{k+1} = Ax_k + Bu_k, \qquad
              y = Cx + Du

    Args:
        name: what people call it.
        A: (n, n).
        B: (n, m).
        C: (outputs, n); all states unless given.
        D: (outputs, m); zero unless given.
        dt: step of a discrete-time plant [s]; None: continuous.
        x_names: a name for each state.
        u_names: a name for each control.

    Raises:
        ProblemError: naming the matrix whose shape or number is wrong.
    """

    name: str
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    D: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    dt: float | None = None
    x_names: tuple[str, ...] = ()
    u_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check every shape."""
        n, m = np.shape(self.A)[0] if np.ndim(self.A) == 2 else 0, np.shape(self.B)[-1]
        c = np.eye(n) if np.size(self.C) == 0 else np.atleast_2d(self.C)
        d = np.zeros((len(c), m)) if np.size(self.D) == 0 else np.atleast_2d(self.D)
        shapes = {"A": (n, n), "B": (n, m), "C": (len(c), n), "D": (len(c), m)}
        for label, given in (("A", self.A), ("B", self.B), ("C", c), ("D", d)):
            checked = matrix(given, shapes[label], f"{self.name}: {label}")
            object.__setattr__(self, label, checked)
        for label, size in (("x", n), ("u", m)):
            names = getattr(self, f"{label}_names") or tuple(f"{label}_{i}" for i in range(size))
            if len(names) != size:
                raise ProblemError(f"{self.name}: {len(names)} names for {size} of {label}")
            object.__setattr__(self, f"{label}_names", tuple(names))

    @classmethod
    def from_transfer_function(
        cls, numerator: ArrayLike, denominator: ArrayLike, *, name: str = "transfer function"
    ) -> "LinearPlant":
        """Return the controller form of a continuous transfer function, through scipy.

        Args:
            numerator: coefficients of s, highest power first.
            denominator: the same, of no lower degree.
            name: what people call it.
        """
        try:
            parts: Any = signal.tf2ss(numerator, denominator)
        except ValueError as error:
            raise ProblemError(f"{name}: {error}") from error
        a, b, c, d = parts
        return cls(name=name, A=a, B=b, C=c, D=d)

    def sampled(self, dt: float) -> "LinearPlant":
        """Return the discrete-time plant under a zero-order hold of dt [s], through scipy."""
        at_least(dt, 0.0, f"{self.name}: dt", strictly=True)
        if self.dt is not None:
            raise ProblemError(f"{self.name}: sampled already, every {self.dt:g} s")
        sampled: Any = signal.cont2discrete((self.A, self.B, self.C, self.D), dt)
        a, b, c, d, _ = sampled
        names = {"x_names": self.x_names, "u_names": self.u_names}
        return LinearPlant(name=self.name, A=a, B=b, C=c, D=d, dt=dt, **names)

    @cached_property
    def model(self) -> Model:
        """The plant as symbols."""
        x = ca.vertcat(*[ca.SX.sym(name) for name in self.x_names])
        u = ca.vertcat(*[ca.SX.sym(name) for name in self.u_names])
        return Model(name=self.name, x=x, u=u, f=_affine(self.A, x, self.B, u), dt=self.dt)

    @property
    def y(self) -> ca.SX:
        """Its outputs in the symbols of ``model``, (outputs,)."""
        return _affine(self.C, self.model.x, self.D, self.model.u)


def state_space(
    A: ArrayLike, B: ArrayLike, *, dt: float | None = None, name: str = "linear"
) -> Model:
    """Return the model of a linear plant; see ``LinearPlant``."""
    return LinearPlant(name=name, A=np.asarray(A), B=np.asarray(B), dt=dt).model


def stable_plant() -> LinearPlant:
    """Return the stable plant of third order of the thesis (2.50, 2.51), sampled every 0.1 s."""
    return LinearPlant(
        name="stable plant",
        A=np.array([[2.5415, -1.0763, 0.6065], [2.0, 0.0, 0.0], [0.0, 0.5, 0.0]]),
        B=np.array([[0.5], [0.0], [0.0]]),
        C=np.array([[0.1813, -0.1562, 0.1343]]),
        dt=0.1,
    )


def unstable_plant() -> LinearPlant:
    """Return the unstable plant of third order of the thesis (2.53, 2.54), sampled every 0.1 s."""
    return LinearPlant(
        name="unstable plant",
        A=np.array([[3.1505, -1.6247, 0.5526], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        B=np.array([[0.5], [0.0], [0.0]]),
        C=np.array([[0.2436, -0.2098, 0.09012]]),
        dt=0.1,
    )


def mass_spring_damper(
    *, stiffness: float = -2.0, damping: float = 1.0, mass: float = 1.0
) -> LinearPlant:
    r"""Return a mass on a spring (2.92); unstable with the thesis' negative stiffness.

    .. math:: m\ddot x = -kx - c\dot x + u

    Args:
        stiffness: k [N/m].
        damping: c [Ns/m].
        mass: m [kg], positive.
    """
    m = at_least(mass, 0.0, "mass-spring-damper: mass", strictly=True)
    return LinearPlant(
        name="mass-spring-damper",
        A=np.array([[0.0, 1.0], [-stiffness / m, -damping / m]]),
        B=np.array([[0.0], [1.0 / m]]),
        C=np.array([[1.0, 0.0]]),
        x_names=("position", "velocity"),
        u_names=("force",),
    )


def lq_regulator(
    plant: LinearPlant,
    *,
    Q: ArrayLike,
    R: ArrayLike,
    P: ArrayLike = 0.0,
    x0: ArrayLike,
    horizon: float,
    control_bounds: Box | None = None,
    state_bounds: Box | None = None,
) -> OCP:
    r"""Return the regulator problem of a plant.

    .. math:: \min \; x_N'Px_N + \sum_{k=0}^{N-1} x_k'Qx_k + u_k'Ru_k

    Source: thesis (2.1) to (2.3); of a continuous plant the cost is integrated.

    Args:
        plant: discrete or continuous.
        Q: state weight (n, n), its diagonal (n,), or one number for all.
        R: control weight, likewise; positive definite.
        P: terminal weight, likewise.
        x0: start (n,).
        horizon: number of steps, or duration [s] of a continuous problem.
        control_bounds: box around the controls.
        state_bounds: box around the states.

    Raises:
        ProblemError: if a weight has a wrong size, is not symmetric or not (semi-)definite.
    """
    return _problem(plant, ca.SX.zeros(len(plant.A)), (), Q, R, P, x0, horizon,
                    (control_bounds, state_bounds))  # fmt: skip


def tracking_ocp(
    plant: LinearPlant,
    reference: ArrayLike,
    *,
    Q: ArrayLike,
    R: ArrayLike,
    P: ArrayLike = 0.0,
    x0: ArrayLike,
    horizon: float,
    control_bounds: Box | None = None,
    state_bounds: Box | None = None,
) -> OCP:
    r"""Return the problem of following a reference w, a signal called ``"reference"``.

    .. math:: \min \; (x_N - w_N)'P(x_N - w_N)
              + \sum_{k=0}^{N-1} (x_k - w_k)'Q(x_k - w_k) + u_k'Ru_k

    Source: thesis (2.14). Arguments and errors as ``lq_regulator``.

    Args:
        plant: discrete or continuous.
        reference: w at the nodes, (N + 1, n).
        Q: state weight.
        R: control weight.
        P: terminal weight.
        x0: start (n,).
        horizon: number of steps, or duration [s].
        control_bounds: box around the controls.
        state_bounds: box around the states.
    """
    w = ca.vertcat(*[ca.SX.sym(f"reference of {name}") for name in plant.x_names])
    signals = (Signal("reference", w, reference),)
    return _problem(plant, w, signals, Q, R, P, x0, horizon, (control_bounds, state_bounds))


def sinusoid(
    t: ArrayLike, *, amplitude: float = 3.0, period: float = 4.0, moving: bool = True
) -> np.ndarray:
    """Return position amplitude sin(2 pi t / period) and its velocity, (len(t), 2).

    Args:
        t: times [s].
        amplitude: of the position.
        period: [s].
        moving: False: the velocity of the reference is zero throughout.
    """
    rate = 2.0 * np.pi / at_least(period, 0.0, "sinusoid: period", strictly=True)
    phase = rate * np.asarray(t, dtype=float)
    velocity = amplitude * rate * np.cos(phase) * float(moving)
    return np.stack([amplitude * np.sin(phase), velocity], axis=1)


def step_reference(t: ArrayLike, value: Sequence[float], *, at: float = 0.0) -> np.ndarray:
    """Return zero before a time and a value from it on, (len(t), n).

    Args:
        t: times [s].
        value: (n,).
        at: when it steps [s].
    """
    times = np.asarray(t, dtype=float)
    return np.where(times[:, None] >= at - 1e-9, np.asarray(value, dtype=float), 0.0)


def thesis_regulator(plant: LinearPlant, steps: int) -> OCP:
    """Return the problem of section 2.1.4: weights (2.55), x0 = (1, 1, 1)."""
    return lq_regulator(plant, Q=100.0, R=500.0, P=10.0, x0=np.ones(3), horizon=steps)


def thesis_tracking(steps: int, *, dt: float = 0.05, moving: bool = True) -> OCP:
    """Return the constrained tracking problem of section 2.2.3: (2.92) to (2.94).

    The thesis does not give the sinusoid; 3 m in 4 s exceeds the bound of 2 m.

    Args:
        steps: horizon N.
        dt: step [s].
        moving: whether the reference has the velocity of the sinusoid, or none.
    """
    return tracking_ocp(
        mass_spring_damper().sampled(dt),
        sinusoid(dt * np.arange(steps + 1), moving=moving),
        Q=[100.0, 10.0],
        R=0.5,
        P=100.0,
        x0=np.zeros(2),
        horizon=steps,
        control_bounds=Box(-40.0, 40.0),
        state_bounds=Box([-2.0, -np.inf], [2.0, np.inf]),
    )


def matrix(values: ArrayLike, shape: tuple[int, int], what: str) -> np.ndarray:
    """Return ``values`` as a read-only finite matrix of a shape, or raise ``ProblemError``."""
    if np.shape(values) != shape:
        raise ProblemError(f"{what} has shape {np.shape(values)}, {shape} is needed")
    result = vector(values, shape[0] * shape[1], what).reshape(shape)
    return result


def weight(values: ArrayLike, size: int, what: str, *, definite: bool = False) -> np.ndarray:
    """Return a symmetric (semi-)definite weight (size, size) of a matrix, a diagonal or a number.

    Raises:
        ProblemError: naming the weight, and its eigenvalue where that is the reason.
    """
    if np.ndim(values) < 2:
        given = np.full(size, values) if np.ndim(values) == 0 else values
        result = np.diag(vector(given, size, what))
    else:
        result = matrix(values, (size, size), what)
    scale = np.abs(result).max()
    if np.abs(result - result.T).max() > _SYMMETRIC * scale:
        raise ProblemError(f"{what} is not symmetric")
    least = float(np.linalg.eigvalsh(result)[0])
    if least < -1e-10 * scale or (definite and least <= 1e-10 * scale):
        kind = "definite" if definite else "semi-definite"
        raise ProblemError(f"{what} is not positive {kind}: it has the eigenvalue {least:.6g}")
    return result


def _affine(a: np.ndarray, x: ca.SX, b: np.ndarray, u: ca.SX) -> ca.SX:
    """A x + B u, without the zeros."""
    return ca.mtimes(ca.sparsify(ca.DM(a)), x) + ca.mtimes(ca.sparsify(ca.DM(b)), u)


def _problem(
    plant: LinearPlant,
    w: ca.SX,
    signals: tuple[Signal, ...],
    q: ArrayLike,
    r: ArrayLike,
    p: ArrayLike,
    x0: ArrayLike,
    horizon: float,
    boxes: tuple[Box | None, Box | None],
) -> OCP:
    model, error = plant.model, plant.model.x - w
    weights = [
        ca.sparsify(ca.DM(weight(given, size, f"{plant.name}: {label}", definite=label == "R")))
        for label, given, size in (("Q", q, model.nx), ("R", r, model.nu), ("P", p, model.nx))
    ]
    return OCP(
        name=f"{plant.name}, {'tracking' if signals else 'regulator'}",
        model=model,
        x0=x0,
        horizon=horizon,
        running_cost=ca.bilin(weights[0], error, error) + ca.bilin(weights[1], model.u, model.u),
        terminal_cost=ca.bilin(weights[2], error, error),
        control_bounds=boxes[0] or Box(),
        state_bounds=boxes[1] or Box(),
        parameters=signals,
    )
