"""A held stage, slope by slope: forwards for the Jacobian, backwards for the Hessian."""

from dataclasses import dataclass, field

import casadi as ca

from ocp.integration.one_step import Integrator
from ocp.problem.ocp import OCP


@dataclass(frozen=True, eq=False)
class Slope:
    """g = step times (f, L) as a function of (x, u, t, h, s, p), at the instant t + s h.

    What a stage is differentiated along is w = (x, v), where v is u or (u, t, h).

    Attributes:
        first: g, its Jacobian in x, and in w with x held, so with zeros in the columns of x.
        second: of (x, u, t, h, s, p, weight) the blocks xx, vx and vv of the Hessian of weight'g.
    """

    first: ca.Function
    second: ca.Function

    @classmethod
    def of(cls, ocp: OCP, integrator: Integrator, *, timed: bool) -> "Slope":
        """Differentiate the slope of a problem, along t and h as well where timed."""
        m = ocp.model
        h, s = ca.SX.sym("h"), ca.SX.sym("s")
        g = ca.vertcat(m.f, ocp.running_cost)
        if not m.is_discrete:
            g = h / integrator.steps * ca.substitute(g, m.t, m.t + s * h)
        given = [m.x, m.u, m.t, h, s, ocp.p]
        v = ca.vertcat(*given[1 : 4 if timed else 2])
        weight = ca.SX.sym("weight", m.nx + 1)
        hessian, _ = ca.hessian(ca.dot(weight, g), ca.vertcat(m.x, v))
        aside = ca.horzcat(ca.SX(m.nx + 1, m.nx), ca.jacobian(g, v))
        blocks = hessian[: m.nx, : m.nx], hessian[m.nx :, : m.nx], hessian[m.nx :, m.nx :]
        return cls(
            first=_apart("slope", given, [g, ca.jacobian(g, m.x), aside]),
            second=_apart("bend", [*given, weight], list(blocks)),
        )


def _apart(name: str, given: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
    """Return a function that is called; inlined, the slopes would be written out one by one."""
    dense = ca.cse([ca.densify(output) for output in outputs])
    return ca.Function(name, given, dense, {"never_inline": True})


@dataclass(frozen=True, eq=False)
class _Visit:
    """One slope on the way: where it was taken, and what it depends on.

    Attributes:
        at: (x, u, t, h, s, p).
        jacobian: of the slope in x.
        along: dx_i/dw, (nx, nw).
        reach: how far along the slope before it lies.
        weight: of the slope in the step.
    """

    at: list[ca.MX]
    jacobian: ca.MX
    along: ca.MX
    reach: float
    weight: float


@dataclass(eq=False)
class StageTape:
    """State, cost and their Jacobians after the slopes visited so far.

    Attributes:
        slope: of the problem.
        given: x, u, t, h, p0, p1 of the stage.
        x: state.
        cost: of the stage.
        along: Jacobian of the state in w, (nx, nw).
        gradient: that of the cost, (1, nw).
    """

    slope: Slope
    given: dict[str, ca.MX]
    substeps: list[list[_Visit]] = field(default_factory=list)

    @classmethod
    def of(
        cls, ocp: OCP, integrator: Integrator, given: dict[str, ca.MX], *, timed: bool = False
    ) -> "StageTape":
        """Walk through a stage.

        Args:
            ocp: the problem.
            integrator: one-step method.
            given: x, u, t, h, p0, p1 of the stage, in this order.
            timed: whether w is (x, u, t, h) instead of (x, u).
        """
        tape = cls(Slope.of(ocp, integrator, timed=timed), given)
        if ocp.model.is_discrete:
            tape._step_discretely()
        else:
            for i in range(integrator.steps):
                tape._step(integrator, i)
        return tape

    def __post_init__(self) -> None:
        """Start at w."""
        self.nx, (_, self.nw) = self.given["x"].numel(), self.slope.first.size_out(2)
        self.x, self.cost = self.given["x"], ca.MX(0)
        self.along = ca.MX(ca.densify(ca.DM.eye(self.nw)[: self.nx, :]))
        self.gradient = ca.MX.zeros(1, self.nw)

    def _step(self, integrator: Integrator, i: int) -> None:
        """Walk through one substep of a continuous-time model."""
        x, along, slope, rise = self.x, self.along, self.x, self.along
        ends, visits = [self.x, self.along, self.cost, self.gradient], []
        for k, (reach, weight) in enumerate(integrator.slopes):
            x = self.x + reach * slope[: self.nx] if k else self.x
            along = self.along + reach * rise[: self.nx, :] if k else self.along
            fraction = (i + reach) / integrator.steps
            visit, slope, rise = self._visit(x, along, fraction, reach=reach, weight=weight)
            visits.append(visit)
            moves = slope[: self.nx], rise[: self.nx, :], slope[self.nx], rise[self.nx, :]
            ends = [end + weight * move for end, move in zip(ends, moves, strict=True)]
        self.x, self.along, self.cost, self.gradient = ends
        self.substeps.append(visits)

    def _step_discretely(self) -> None:
        """Take the one step of a discrete-time model, whose slope is the next state itself."""
        visit, slope, rise = self._visit(self.x, self.along, 0.0, reach=0.0, weight=1.0)
        self.substeps.append([visit])
        self.x, self.along = slope[: self.nx], rise[: self.nx, :]
        self.cost, self.gradient = slope[self.nx], rise[self.nx, :]

    def _visit(
        self, x: ca.MX, along: ca.MX, fraction: float, *, reach: float, weight: float
    ) -> tuple[_Visit, ca.MX, ca.MX]:
        """Return a slope's place, the slope, and d(slope)/dw."""
        p0, p1 = self.given["p0"], self.given["p1"]
        u, t, h = list(self.given.values())[1:4]
        at = [x, u, t, h, ca.MX(fraction), p0 + fraction * (p1 - p0)]
        slope, jacobian, aside = self.slope.first.call(at)
        return _Visit(at, jacobian, along, reach, weight), slope, aside + jacobian @ along

    def hessian(self, costate: ca.MX, price: ca.MX) -> ca.MX:
        """Return the second derivative of price times cost + costate'x, (nw, nw).

        Goes backwards: the weights of the slopes are the adjoint of the step.
        """
        nx, nw = self.nx, self.nw
        hessian, mixed = ca.MX.zeros(nw, nw), ca.MX.zeros(nw - nx, nw)
        own = ca.MX.zeros(nw - nx, nw - nx)
        for visits in reversed(self.substeps):
            before = costate
            pull = ca.MX.zeros(nx)  # of the slope behind on this one
            for visit in reversed(visits):
                weight = ca.vertcat(visit.weight * costate + pull, visit.weight * price)
                # Z' H Z of the slope, with Z = (dx_i/dw; dv/dw).
                xx, vx, vv = self.slope.second.call([*visit.at, weight])
                hessian += visit.along.T @ (xx @ visit.along)
                mixed, own = mixed + vx @ visit.along, own + vv
                back = visit.jacobian.T @ weight
                before, pull = before + back, visit.reach * back
            costate = before
        mixed = ca.vertcat(ca.MX.zeros(nx, nw), mixed)
        return hessian + mixed + mixed.T + ca.densify(ca.diagcat(ca.MX(nx, nx), own))
