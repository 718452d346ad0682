"""What is known at an iterate, and the Newton step from there: a function each."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from ocp import OCP, Buffered, Integrator, Stage, compiled, curvature
from solvers.direct.riccati_sweep import backwards, follow, forwards


@dataclass(frozen=True, eq=False)
class Iterate:
    """States (nx, N + 1), held controls (nu, N) and costates (nx, N + 1), with x_0 given."""

    x: np.ndarray
    u: np.ndarray
    costate: np.ndarray


@dataclass(frozen=True, eq=False)
class View:
    r"""What is known at an iterate: the Newton step, and how good the iterate is.

    With gaps c_k = F(x_k, u_k) - x_{k+1} and stage costs l the Lagrangian is

    .. math:: \sum_k l(x_k, u_k) + p_{k+1}' c_k + \varphi(x_N) - p_0' x_0.

    Attributes:
        law: for every stage (2 nx + nu, nx + 1), see ``backwards``, side by side.
        gap_by_stage: c (nx, N).
        pivots: of every Q_uu, relative to its diagonal, (nu, N).
        cost: the sum of the stages' costs and the final one.
        gaps: sum of abs(c).
        gap: norm of c.
        slope: norm of the Lagrangian's slopes in states and controls.
        largest_costate: largest abs(p).
        next_costate: largest abs(p) after the step.
        cost_slope: slope of the cost along the step.
        bend: second derivative of the (shifted) Lagrangian along the step.
        size: largest element of H_uu and H_ux, to measure a shift by.
    """

    law: np.ndarray
    gap_by_stage: np.ndarray
    pivots: np.ndarray
    cost: float
    gaps: float
    gap: float
    slope: float
    largest_costate: float
    next_costate: float
    cost_slope: float
    bend: float
    size: float

    # A pivot below this share of its diagonal is zero but for rounding.
    definite: ClassVar[float] = 1e-10

    @property
    def residual(self) -> float:
        """The gaps, or the slopes relative to 1 + abs(p), whichever is larger.

        A gap c changes the cost by p'c: where that, relative to 1 + abs(cost), is more than the
        gap itself, it counts.
        """
        worth = self.largest_costate / (1.0 + abs(self.cost))
        return max(self.gap * max(1.0, worth), self.slope / (1.0 + self.largest_costate))

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
    """The Newton step of a problem on N intervals.

    Attributes:
        look: (x, u, costate, sigma, data) to what ``View`` consists of; the data are t, h, p0,
            p1 of all stages, and the parameters at the end.
        go: (x, u, costate, share, law, gaps, data) to x, u, costate.
    """

    look: Buffered
    go: Buffered

    @classmethod
    def of(cls, ocp: OCP, n: int, integrator: Integrator, *, fast: bool) -> "NewtonStep":
        """Build it; ``fast``: stage and recursion as machine code."""
        return cls(
            Buffered(_look(ocp, n, integrator, fast)), Buffered(_go(ocp, n, integrator, fast))
        )

    def view(self, at: Iterate, sigma: float, schedule: list[np.ndarray]) -> View:
        """Evaluate.

        Args:
            at: the iterate.
            sigma: shift of every H_uu (Levenberg), in the space of the controls: with the gaps
                closed it is added to the second derivative of the cost as a function of the
                controls alone, which is positive definite if and only if every Q_uu is.
            schedule: t, h, p0, p1 of all stages, and the parameters at the end.
        """
        law, gap, pivots, numbers = self.look(at.x, at.u, at.costate, sigma, *schedule)
        return View(law, gap, pivots, *numbers.ravel().tolist())

    def moved(self, at: Iterate, view: View, share: float, schedule: list[np.ndarray]) -> Iterate:
        """Return where a share of the step from an iterate leads, by the model itself."""
        laws = (view.law, view.gap_by_stage)
        return Iterate(*self.go(at.x, at.u, at.costate, share, *laws, *schedule))


def _symbols(ocp: OCP, n: int) -> dict[str, ca.MX]:
    nx, nu, n_p = ocp.model.nx, ocp.model.nu, ocp.p.numel()
    shapes = {"x": (nx, n + 1), "u": (nu, n), "costate": (nx, n + 1), "share": (1, 1)}
    shapes |= {"law": (2 * nx + nu, (nx + 1) * n), "gap": (nx, n)}
    shapes |= {"t": (1, n), "h": (1, n), "p0": (n_p, n), "p1": (n_p, n), "p_final": (n_p, 1)}
    return {name: ca.MX.sym(name, *shape) for name, shape in shapes.items()}


def _go(ocp: OCP, n: int, integrator: Integrator, fast: bool) -> ca.Function:
    """Return the law followed by the model: see ``NewtonStep.go``."""
    s = _symbols(ocp, n)
    stage = follow(Stage.of(ocp, integrator, held=True).step)
    run = (compiled(stage) if fast else stage).mapaccum(n)
    x, costate, share = s["x"], s["costate"], s["share"]
    data = [s[name] for name in ("t", "h", "p0", "p1")]
    along = (x[:, :-1], s["u"], costate[:, :-1], *data)
    after, u, before = run(x[:, 0], ca.repmat(share, 1, n), s["law"], s["gap"], *along)
    _, slope, hessian = _end(ocp)(x[:, -1], s["t"][-1] + s["h"][-1], s["p_final"])
    last = costate[:, -1] + share * (slope - costate[:, -1]) + hessian @ (after[:, -1] - x[:, -1])
    results = [ca.horzcat(x[:, 0], after), u, ca.horzcat(before, last)]
    return ca.Function("go", list(s.values()), results)


def _look(ocp: OCP, n: int, integrator: Integrator, fast: bool) -> ca.Function:
    """Return the stages and the recursion: see ``NewtonStep.look``."""
    nx, nu = ocp.model.nx, ocp.model.nu
    s = _symbols(ocp, n)
    del s["law"], s["gap"]
    s["sigma"] = s.pop("share")
    order = ("x", "u", "costate", "sigma", "t", "h", "p0", "p1", "p_final")
    s = {name: s[name] for name in order}
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
    law = law[:, in_order]
    dx, du, dcostate = run.mapaccum(n)(ca.MX.zeros(nx), law)
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
        ca.norm_inf(ca.vec(costate + dcostate)),
        # From the step's own equations: the gaps close linearly, the slopes vanish.
        along + ca.dot(costate[:, 1:], gap),
        ca.dot(dcostate[:, 1:], gap) - along,
        ca.norm_inf(ca.vec(hessian[nx:, :])),
    ]
    results = [law, gap, pivots[:, last_first], ca.vertcat(*numbers)]
    return ca.Function("look", list(s.values()), results)


def _end(ocp: OCP) -> ca.Function:
    """Return the terminal cost with its first and second derivatives."""
    x, t, p = ocp.model.x, ocp.model.t, ocp.p
    hessian, gradient = ca.hessian(ca.SX(ocp.terminal_cost), x)
    outputs = [ca.densify(each) for each in (ocp.terminal_cost, gradient, hessian)]
    return ca.Function("end", [x, t, p], outputs)
