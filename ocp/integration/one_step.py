"""One-step integrators, and a problem's stage: state and cost after one step."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from ocp.checks.arguments import check_whole
from ocp.checks.errors import UnsupportedProblem
from ocp.problem.ocp import OCP

# Written for SX; MX does as well, where a control law holds a root finder.
Rate = Callable[[ca.SX, ca.SX | float], ca.SX]


@dataclass(frozen=True)
class Integrator(ABC):
    """A one-step method, applied ``steps`` times per interval.

    Args:
        steps: equal substeps in each interval.

    Raises:
        ProblemError: if ``steps`` is not a whole number of at least 1.
    """

    steps: int = 1

    def __post_init__(self) -> None:
        """Check the number of substeps."""
        check_whole(self.steps, "an integrator's number of steps")

    def __call__(self, rate: Rate, z: ca.SX, s: ca.SX | float, h: ca.SX | float) -> ca.SX:
        """Return z(s + h) for dz/ds = rate(z, s), an expression of the shape of z."""
        substep = h / self.steps
        for i in range(self.steps):
            z = self.substep(rate, z, s + i * substep, substep)
        return z

    @property
    @abstractmethod
    def order(self) -> int:
        """P of the error O(h^p) over a horizon."""

    @abstractmethod
    def substep(self, rate: Rate, z: ca.SX, s: ca.SX | float, h: ca.SX | float) -> ca.SX:
        """Return z after one substep."""


@dataclass(frozen=True)
class ExplicitIntegrator(Integrator):
    r"""An explicit method, in which each slope needs only the one before it.

    .. math:: k_i = g(z + a_i h\, k_{i-1}, \; s + a_i h), \qquad z(s + h) = z + h \sum_i b_i k_i

    for dz/ds = g(z, s).

    Args:
        steps: equal substeps in each interval.
    """

    @property
    @abstractmethod
    def slopes(self) -> tuple[tuple[float, float], ...]:
        """Reach a_i and weight b_i of every slope."""

    def substep(self, rate: Rate, z: ca.SX, s: ca.SX | float, h: ca.SX | float) -> ca.SX:
        """Return z + h (sum of weight times slope) after one substep."""
        slope, moved = z, z
        for i, (reach, weight) in enumerate(self.slopes):
            slope = rate(z + reach * h * slope if i else z, s + reach * h)
            moved = moved + weight * h * slope
        return moved


@dataclass(frozen=True)
class Euler(ExplicitIntegrator):
    """Explicit Euler, z + h g(z, s), order 1: what the thesis' simulations use.

    Args:
        steps: equal substeps in each interval.
    """

    @property
    def order(self) -> int:
        """1."""
        return 1

    @property
    def slopes(self) -> tuple[tuple[float, float], ...]:
        """One slope, at the start."""
        return ((0.0, 1.0),)


@dataclass(frozen=True)
class Midpoint(ExplicitIntegrator):
    """Explicit midpoint rule, z + h g(z + h k_1/2, s + h/2), order 2.

    Args:
        steps: equal substeps in each interval.
    """

    @property
    def order(self) -> int:
        """2."""
        return 2

    @property
    def slopes(self) -> tuple[tuple[float, float], ...]:
        """The slope in the middle."""
        return (0.0, 0.0), (0.5, 1.0)


@dataclass(frozen=True)
class RK4(ExplicitIntegrator):
    """The classical Runge-Kutta method, z + h (k_1 + 2 k_2 + 2 k_3 + k_4)/6, order 4.

    Args:
        steps: equal substeps in each interval.
    """

    @property
    def order(self) -> int:
        """4."""
        return 4

    @property
    def slopes(self) -> tuple[tuple[float, float], ...]:
        """Weights 1/6, 1/3, 1/3, 1/6."""
        return (0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6)


@dataclass(frozen=True, eq=False)
class Stage:
    """One step of a problem, from (x, u, t, h, p0, p1) or (x, u0, u1, t, h, p0, p1).

    Controls and parameters run linearly from u0, p0 at t to u1, p1 at t + h; a held control
    has only u, a curved one also its value in the middle, (x, u0, um, u1, ...). A discrete-time
    model takes u0, p0 and ignores h.

    Attributes:
        step: -> (x after the step, cost of the step).
        adjoint: (costate after, x, u, ...) -> (costate before, dJ/du) or (..., dJ/du0, dJ/du1),
            with dJ/dum between them, the exact derivative of the *discretised* cost.
    """

    step: ca.Function
    adjoint: ca.Function

    @classmethod
    def of(cls, ocp: OCP, integrator: Integrator, *, held: bool, curved: bool = False) -> "Stage":
        """Build the stage of a problem under an integrator, for a control of one kind."""
        m, n_p = ocp.model, ocp.p.numel()
        controls = ("u0",) if held else ("u0", "um", "u1") if curved else ("u0", "u1")
        sizes = {"x": m.nx, **dict.fromkeys(controls, m.nu), "t": 1, "h": 1, "p0": n_p, "p1": n_p}
        symbols = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
        after, cost = _one_step(ocp, integrator, {"u1": symbols["u0"], **symbols})
        costate = ca.SX.sym("costate", m.nx)
        total = cost + ca.dot(costate, after)
        wanted = [v for name, v in symbols.items() if name in ("x", *controls)]
        gradients = [ca.densify(ca.gradient(total, v)) for v in wanted]
        inputs, names = list(symbols.values()), list(symbols)
        return cls(
            step=ca.Function("step", inputs, [after, cost], names, ["x_next", "cost"]),
            adjoint=ca.Function("adjoint", [costate, *inputs], gradients),
        )


def require_explicit(ocp: OCP, integrator: Integrator, method: str) -> ExplicitIntegrator:
    """Return an integrator whose slopes are known one by one.

    Raises:
        UnsupportedProblem: if it is none.
    """
    if not isinstance(integrator, ExplicitIntegrator):
        raise UnsupportedProblem(
            f"{ocp.name}: {method} takes explicit integrators, not {type(integrator).__name__}; "
            "take MultipleShooting with ipopt or fatrop, or Collocation"
        )
    return integrator


def _one_step(ocp: OCP, integrator: Integrator, s: dict[str, ca.SX]) -> tuple[ca.SX, ca.SX]:
    nx, functions = ocp.model.nx, ocp.functions
    if ocp.model.is_discrete:
        now = (s["x"], s["u0"], s["t"], s["p0"])
        return functions.rate(*now), functions.running_cost(*now)

    def rate(z: ca.SX, fraction: ca.SX | float) -> ca.SX:
        """d(x, cost) over the fraction of the interval, in [0, 1]."""
        p = interpolate(s["p0"], s["p1"], fraction)
        now = (z[:nx], _control(s, fraction), s["t"] + fraction * s["h"], p)
        return s["h"] * ca.vertcat(functions.rate(*now), functions.running_cost(*now))

    end = integrator(rate, ca.vertcat(s["x"], 0), 0.0, 1.0)
    return end[:nx], end[nx]


def _control(s: dict[str, ca.SX], fraction: ca.SX | float) -> ca.SX:
    """The line through u0 and u1, or the parabola through um as well."""
    line = interpolate(s["u0"], s["u1"], fraction)
    if "um" not in s:
        return line
    return line + 4.0 * fraction * (1.0 - fraction) * (s["um"] - (s["u0"] + s["u1"]) / 2)


def interpolate(left: ca.SX, right: ca.SX, s: ca.SX | float) -> ca.SX:
    """Return left + s (right - left), which is free of rounding where both ends are equal.

    Args:
        left: value at s = 0 (n,).
        right: value at s = 1 (n,).
        s: fraction of the way, 0 to 1.
    """
    return left + s * (right - left)
