"""A held stage, slope by slope: forwards for the Jacobian, backwards for the Hessian."""

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from ocp.integration.one_step import ExplicitIntegrator, Integrator, require_explicit
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
            first=_called("slope", given, [g, ca.jacobian(g, m.x), aside]),
            second=_called("bend", [*given, weight], list(blocks)),
        )


def _called(name: str, given: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
    """Return a function that is called; inlined, the slopes would be written out one by one."""
    dense = ca.cse([ca.densify(output) for output in outputs])
    return ca.Function(name, given, dense, {"never_inline": True})


class StageInputs(NamedTuple):
    """State, control, time, step, and the parameters at both ends of a stage."""

    x: ca.MX
    u: ca.MX
    t: ca.MX
    h: ca.MX
    p0: ca.MX
    p1: ca.MX


class Progress(NamedTuple):
    """What a stage has come to, with its derivatives along w.

    Attributes:
        x: state.
        cost: of the stage.
        state_jacobian: dx/dw, (nx, nw).
        cost_gradient: dcost/dw, (1, nw).
    """

    x: ca.MX
    cost: ca.MX
    state_jacobian: ca.MX
    cost_gradient: ca.MX

    def plus(self, weight: float, move: "Progress") -> "Progress":
        """Return this plus a weighted slope."""
        return Progress(*[own + weight * other for own, other in zip(self, move, strict=True)])


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


@dataclass(frozen=True, eq=False)
class StageTape:
    """A stage, and every slope that was evaluated on the way.

    Attributes:
        slope: of the problem.
        end: state and cost after the stage, with their Jacobians in w.
        substeps: the slopes of each.
    """

    slope: Slope
    end: Progress
    substeps: tuple[tuple[_Visit, ...], ...]

    @classmethod
    def of(
        cls, ocp: OCP, integrator: Integrator, given: StageInputs, *, timed: bool = False
    ) -> "StageTape":
        """Walk through a stage.

        Args:
            ocp: the problem.
            integrator: one-step method.
            given: the symbols of the stage.
            timed: whether w is (x, u, t, h) instead of (x, u).
        """
        slope = Slope.of(ocp, integrator, timed=timed)
        nx, (_, nw) = ocp.model.nx, slope.first.size_out(2)
        begin = Progress(
            given.x, ca.MX(0), ca.MX(ca.densify(ca.DM.eye(nw)[:nx, :])), ca.MX.zeros(1, nw)
        )
        if ocp.model.is_discrete:  # one step, whose slope is the next state itself
            visit, end = _visit(slope, given, begin, 0.0, reach=0.0, weight=1.0)
            return cls(slope, end, ((visit,),))
        explicit = require_explicit(ocp, integrator, "a method that differentiates slope by slope")
        substeps, end = [], begin
        for i in range(integrator.steps):
            visits, end = _substep(slope, given, end, explicit, i)
            substeps.append(visits)
        return cls(slope, end, tuple(substeps))

    def hessian(self, costate: ca.MX, price: ca.MX) -> ca.MX:
        """Return the second derivative of price times cost + costate'x, (nw, nw).

        Goes backwards: the weights of the slopes are the adjoint of the step.
        """
        nx, nw = self.end.state_jacobian.shape
        hessian, mixed = ca.MX.zeros(nw, nw), ca.MX.zeros(nw - nx, nw)
        own = ca.MX.zeros(nw - nx, nw - nx)
        for visits in reversed(self.substeps):
            before = costate
            from_next = ca.MX.zeros(nx)  # the part of the adjoint that the next slope adds
            for visit in reversed(visits):
                weight = ca.vertcat(visit.weight * costate + from_next, visit.weight * price)
                # Z' H Z of the slope, with Z = (dx_i/dw; dv/dw).
                xx, vx, vv = self.slope.second.call([*visit.at, weight])
                hessian += visit.along.T @ (xx @ visit.along)
                mixed, own = mixed + vx @ visit.along, own + vv
                back = visit.jacobian.T @ weight
                before, from_next = before + back, visit.reach * back
            costate = before
        mixed = ca.vertcat(ca.MX.zeros(nx, nw), mixed)
        return hessian + mixed + mixed.T + ca.densify(ca.diagcat(ca.MX(nx, nx), own))


def _substep(
    slope: Slope, given: StageInputs, begin: Progress, integrator: ExplicitIntegrator, i: int
) -> tuple[tuple[_Visit, ...], Progress]:
    """Walk through one substep of a continuous-time model."""
    end, before, visits = begin, begin, []
    for k, (reach, weight) in enumerate(integrator.slopes):
        here = begin.plus(reach, before) if k else begin
        fraction = (i + reach) / integrator.steps
        visit, before = _visit(slope, given, here, fraction, reach=reach, weight=weight)
        visits.append(visit)
        end = end.plus(weight, before)
    return tuple(visits), end


def _visit(
    slope: Slope,
    given: StageInputs,
    here: Progress,
    fraction: float,
    *,
    reach: float,
    weight: float,
) -> tuple[_Visit, Progress]:
    """Evaluate a slope; return where that was, and the slope of everything in ``Progress``."""
    p = given.p0 + fraction * (given.p1 - given.p0)
    at = [here.x, given.u, given.t, given.h, ca.MX(fraction), p]
    value, jacobian, aside = slope.first.call(at)
    rise = aside + jacobian @ here.state_jacobian
    nx = here.x.numel()
    move = Progress(value[:nx], value[nx], rise[:nx, :], rise[nx, :])
    return _Visit(at, jacobian, here.state_jacobian, reach, weight), move
