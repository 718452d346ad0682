"""Linear plants: state space and transfer functions, and those of the thesis."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import vector
from ocp import Model, ProblemError
from ocp.internal import check_positive, check_real


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
        for label in ("A", "B"):
            if np.ndim(getattr(self, label)) != 2:
                raise ProblemError(f"{self.name}: {label} is no matrix")
        n, m = len(self.A), np.shape(self.B)[1]
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
        from scipy import signal  # imports half of scipy: a second that few need

        try:
            parts: Any = signal.tf2ss(numerator, denominator)
        except ValueError as error:
            raise ProblemError(f"{name}: {error}") from error
        a, b, c, d = parts
        return cls(name=name, A=a, B=b, C=c, D=d)

    def sampled(self, dt: float) -> "LinearPlant":
        """Return the discrete-time plant under a zero-order hold of dt [s], through scipy."""
        check_positive(dt, f"{self.name}: dt")
        if self.dt is not None:
            raise ProblemError(f"{self.name}: sampled already, every {self.dt:g} s")
        from scipy import signal  # as above

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
    k = check_real(stiffness, "mass-spring-damper: stiffness")
    c = check_real(damping, "mass-spring-damper: damping")
    m = check_positive(mass, "mass-spring-damper: mass")
    return LinearPlant(
        name="mass-spring-damper",
        A=np.array([[0.0, 1.0], [-k / m, -c / m]]),
        B=np.array([[0.0], [1.0 / m]]),
        C=np.array([[1.0, 0.0]]),
        x_names=("position", "velocity"),
        u_names=("force",),
    )


def matrix(values: ArrayLike, shape: tuple[int, int], what: str) -> np.ndarray:
    """Return ``values`` as a read-only finite matrix of a shape, or raise ``ProblemError``."""
    if np.shape(values) != shape:
        raise ProblemError(f"{what} has shape {np.shape(values)}, {shape} is needed")
    result = vector(values, shape[0] * shape[1], what).reshape(shape)
    return result


def _affine(a: np.ndarray, x: ca.SX, b: np.ndarray, u: ca.SX) -> ca.SX:
    """A x + B u, without the zeros."""
    return ca.mtimes(ca.sparsify(ca.DM(a)), x) + ca.mtimes(ca.sparsify(ca.DM(b)), u)
