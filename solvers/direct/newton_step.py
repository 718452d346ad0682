"""What is known at an iterate, and the Newton step from there, as one function."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from ocp import OCP, Buffered, Integrator, compiled, curvature
from solvers.direct.riccati_sweep import backwards, forwards


@dataclass(frozen=True, eq=False)
class Iterate:
    """States (nx, N + 1), held controls (nu, N) and costates (nx, N + 1), with x_0 given."""

    x: np.ndarray
    u: np.ndarray
    costate: np.ndarray

    def moved(self, view: "View", share: float) -> "Iterate":
        """Return the iterate after a share of a Newton step."""
        return Iterate(
            self.x + share * view.dx, self.u + share * view.du, self.costate + share * view.dcostate
        )


@dataclass(frozen=True, eq=False)
class View:
    r"""What is known at an iterate: the Newton step, and how good the iterate is.

    With gaps c_k = F(x_k, u_k) - x_{k+1} and stage costs l the Lagrangian is

    .. math:: \sum_k l(x_k, u_k) + p_{k+1}' c_k + \varphi(x_N) - p_0' x_0.

    Attributes:
        dx: step of the states (nx, N + 1).
        du: of the controls (nu, N).
        dcostate: of the costates (nx, N + 1).
        pivots: of every Q_uu, relative to its diagonal, (nu, N).
        cost: the sum of the stages' costs and the final one.
        gaps: sum of abs(c).
        gap: norm of c.
        slope: norm of the Lagrangian's slopes in states and controls.
        largest_costate: largest abs(p).
        cost_slope: slope of the cost along the step.
        bend: second derivative of the (shifted) Lagrangian along the step.
        size: largest row sum of H_uu and H_ux, to measure a shift by.
    """

    dx: np.ndarray
    du: np.ndarray
    dcostate: np.ndarray
    pivots: np.ndarray
    cost: float
    gaps: float
    gap: float
    slope: float
    largest_costate: float
    cost_slope: float
    bend: float
    size: float

    # A pivot below this share of its diagonal is zero but for rounding.
    definite: ClassVar[float] = 1e-10

    @property
    def residual(self) -> float:
        """The gaps, or the slopes relative to 1 + abs(p), whichever is larger."""
        return max(self.gap, self.slope / (1.0 + self.largest_costate))

    @property
    def is_finite(self) -> bool:
        """Whether the iterate means anything."""
        return bool(np.isfinite([self.cost, self.gaps, self.slope]).all())

    @property
    def is_convex(self) -> bool:
        """Whether every Q_uu is positive definite: the step leads to a minimum of its model."""
        return bool(self.pivots.min() > self.definite) and bool(np.isfinite(self.bend))


@dataclass(frozen=True, eq=False)
class NewtonStep:
    """The function of a problem on N intervals.

    Attributes:
        function: (x, u, costate, sigma, t, h, p0, p1, p at the end), columns over the stages,
            to what ``View`` consists of.
    """

    function: Buffered

    @classmethod
    def of(cls, ocp: OCP, n: int, integrator: Integrator, *, fast: bool) -> "NewtonStep":
        """Build it; ``fast``: stage and recursion as machine code."""
        return cls(Buffered(_function(ocp, n, integrator, fast)))

    def view(self, at: Iterate, sigma: float, schedule: list[np.ndarray]) -> View:
        """Evaluate.

        Args:
            at: the iterate.
            sigma: shift of every H_uu (Levenberg), in the space of the controls: with the gaps
                closed it is added to the second derivative of the cost as a function of the
                controls alone, which is positive definite if and only if every Q_uu is.
            schedule: t, h, p0, p1 of all stages, and the parameters at the end.
        """
        results = self.function(at.x, at.u, at.costate, sigma, *schedule)
        dx, du, dcostate, pivots, numbers = results
        return View(dx, du, dcostate, pivots, *numbers.ravel().tolist())


def _function(ocp: OCP, n: int, integrator: Integrator, fast: bool) -> ca.Function:
    nx, nu, n_p = ocp.model.nx, ocp.model.nu, ocp.p.numel()
    shapes = {"x": (nx, n + 1), "u": (nu, n), "costate": (nx, n + 1), "sigma": (1, 1)}
    shapes |= {"t": (1, n), "h": (1, n), "p0": (n_p, n), "p1": (n_p, n), "p_final": (n_p, 1)}
    s = {name: ca.MX.sym(name, *shape) for name, shape in shapes.items()}
    x, costate = s["x"], s["costate"]
    parts = [curvature(ocp, integrator), backwards(nx, nu), forwards(nx, nu)]
    stage, sweep, run = map(compiled, parts) if fast else parts
    # The recursion runs backwards, so the stages are evaluated in its order.
    last_first = list(range(n - 1, -1, -1))
    inputs = [x[:, :-1], *[s[name] for name in ("u", "t", "h", "p0", "p1")], costate[:, 1:]]
    outputs = stage.map(n)(*[each[:, last_first] for each in inputs])
    after, cost, jacobian, slope, hessian = outputs
    gap = after - x[:, 1:][:, last_first]
    slope = slope - ca.vertcat(costate[:, :-1][:, last_first], ca.MX.zeros(nu, n))
    end_cost, end_slope, end_hessian = _end(ocp)(x[:, -1], s["t"][-1] + s["h"][-1], s["p_final"])
    end_slope = end_slope - costate[:, -1]
    shift = ca.repmat(s["sigma"], 1, n)
    start = ca.horzcat(end_hessian, end_slope)
    _, law, pivots = sweep.mapaccum(n)(start, hessian, jacobian, slope, gap, shift)
    in_order = [(nx + 1) * k + i for k in last_first for i in range(nx + 1)]
    dx, du, dcostate = run.mapaccum(n)(ca.MX.zeros(nx), law[:, in_order])
    dx = ca.horzcat(ca.MX.zeros(nx), dx)
    dcostate = ca.horzcat(dcostate, end_hessian @ dx[:, -1] + end_slope)
    slope, gap = slope[:, last_first], gap[:, last_first]
    along = ca.dot(slope, ca.vertcat(dx[:, :-1], du)) + ca.dot(end_slope, dx[:, -1])
    numbers = [
        ca.sum2(cost) + end_cost,
        ca.norm_1(ca.vec(gap)),
        # Norms of squares: the largest number of CasADi does not see NaN.
        ca.norm_2(ca.vec(gap)),
        ca.norm_2(ca.vertcat(ca.vec(slope), end_slope)),
        ca.norm_inf(ca.vec(costate)),
        # From the step's own equations: the gaps close linearly, the slopes vanish.
        along + ca.dot(costate[:, 1:], gap),
        ca.dot(dcostate[:, 1:], gap) - along,
        ca.norm_inf(ca.vec(hessian[nx:, :])),
    ]
    results = [dx, du, dcostate, pivots[:, last_first], ca.vertcat(*numbers)]
    return ca.Function("newton_step", list(s.values()), results)


def _end(ocp: OCP) -> ca.Function:
    """Return the terminal cost with its first and second derivatives."""
    x, t, p = ocp.model.x, ocp.model.t, ocp.p
    hessian, gradient = ca.hessian(ca.SX(ocp.terminal_cost), x)
    outputs = [ca.densify(each) for each in (ocp.terminal_cost, gradient, hessian)]
    return ca.Function("end", [x, t, p], outputs)
