"""The second derivatives of a stage, put together from those of one slope."""

from dataclasses import dataclass, field

import casadi as ca

from ocp.integrate import Integrator
from ocp.problem import OCP


def curvature(ocp: OCP, integrator: Integrator) -> ca.Function:
    r"""Return a held stage with its exact first and second derivatives.

    With w = (x, u), the state F(w) after the stage, its cost l(w) and the costate p after it:

    .. math:: (x, u, t, h, p_0, p_1, p) \mapsto
              (F, \; l, \; F_w, \; (l + p'F)_w, \; (l + p'F)_{ww})

    of shapes (nx,), (), (nx, nw), (nw,), (nw, nw); F and l are those of ``Stage``.

    Every slope k_i = g(z_i) of the integrator is a function of z_i = (x + a_i h k_{i-1}, u). Its
    derivatives J_i = g_z and, for a weight m, H_i = (m'g)_zz are functions of their own,
    called for each slope, so that the code does not grow with the number of slopes and steps.
    The Jacobian follows the slopes forwards, the weights of the slopes (the adjoint of the
    step) backwards, and with Z_i = dz_i/dw the second derivative is the sum of Z_i' H_i Z_i:
    curvature of anything but the slopes there is none. Written out for all slopes at once the
    same takes 4 to 8 times the code on arms with 3 to 6 links.
    Source: [Griewank & Walther 2008], chapter 5.

    Args:
        ocp: the problem; what depends on a free final time is left out.
        integrator: one-step method.
    """
    m, n_p = ocp.model, ocp.p.numel()
    sizes = {"x": m.nx, "u": m.nu, "t": 1, "h": 1, "p0": n_p, "p1": n_p, "costate": m.nx}
    s = {name: ca.MX.sym(name, size) for name, size in sizes.items()}
    tape = _Tape(_Slope.of(ocp), s)
    if m.is_discrete:
        tape.step_discretely()
    else:
        for i in range(integrator.steps):
            tape.step(integrator, i)
    outputs = tape.outputs()
    names = ["x_next", "cost", "jacobian", "slope", "hessian"]
    return ca.Function("curvature", list(s.values()), outputs, list(s), names)


@dataclass(frozen=True, eq=False)
class _Slope:
    """g = (f, L) of (x, u, t, p) with its Jacobian in (x, u), and the Hessian of weight'g."""

    first: ca.Function
    second: ca.Function

    @classmethod
    def of(cls, ocp: OCP) -> "_Slope":
        m, p = ocp.model, ocp.p
        w, g = ca.vertcat(m.x, m.u), ca.vertcat(m.f, ocp.running_cost)
        weight = ca.SX.sym("weight", m.nx + 1)
        hessian, _ = ca.hessian(ca.dot(weight, g), w)
        # Inlined, the slopes would be written out one by one.
        apart = {"never_inline": True}
        values = ca.cse([ca.densify(g), ca.densify(ca.jacobian(g, w))])
        return cls(
            first=ca.Function("slope", [m.x, m.u, m.t, p], values, apart),
            second=ca.Function(
                "bend", [m.x, m.u, m.t, p, weight], ca.cse([ca.densify(hessian)]), apart
            ),
        )


@dataclass(frozen=True, eq=False)
class _Visit:
    """One slope on the way: where it was taken, and what it depends on.

    Attributes:
        at: (x, u, t, p).
        jacobian: of the slope in (x, u), times the step.
        along: dx_i/dw, (nx, nw).
        reach: how far along the slope before it lies.
        weight: of the slope in the step.
        step: its length h; 1 for a discrete-time model.
    """

    at: tuple[ca.MX, ca.MX, ca.MX, ca.MX]
    jacobian: ca.MX
    along: ca.MX
    reach: float
    weight: float
    step: ca.MX


@dataclass(eq=False)
class _Tape:
    """A stage as it is walked through: forwards by ``step``, backwards by ``outputs``."""

    slope: _Slope
    given: dict[str, ca.MX]
    substeps: list[list[_Visit]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Start at (x, u)."""
        self.nx, self.nu = self.given["x"].numel(), self.given["u"].numel()
        self.x, self.cost = self.given["x"], ca.MX(0)
        self.along = ca.MX(ca.densify(ca.DM.eye(self.nx + self.nu)[: self.nx, :]))
        self.gradient = ca.MX.zeros(1, self.nx + self.nu)

    def step(self, integrator: Integrator, i: int) -> None:
        """Walk through one substep of a continuous-time model."""
        h, visits = self.given["h"] / integrator.steps, []
        x, along, slope, rise = self.x, self.along, self.x, self.along
        ends = [self.x, self.along, self.cost, self.gradient]
        for k, (reach, weight) in enumerate(integrator.slopes):
            x = self.x + reach * slope[: self.nx] if k else self.x
            along = self.along + reach * rise[: self.nx, :] if k else self.along
            place = (x, along, (i + reach) / integrator.steps, h)
            visit, slope, rise = self._visit(*place, reach=reach, weight=weight)
            visits.append(visit)
            moves = slope[: self.nx], rise[: self.nx, :], slope[self.nx], rise[self.nx, :]
            ends = [end + weight * move for end, move in zip(ends, moves, strict=True)]
        self.x, self.along, self.cost, self.gradient = ends
        self.substeps.append(visits)

    def step_discretely(self) -> None:
        """Take the one step of a discrete-time model, whose slope is the next state itself."""
        one = ca.MX(1)
        place = (self.x, self.along, 0.0, one)
        visit, slope, rise = self._visit(*place, reach=0.0, weight=1.0)
        self.substeps.append([visit])
        self.x, self.along = slope[: self.nx], rise[: self.nx, :]
        self.cost, self.gradient = slope[self.nx], rise[self.nx, :]

    def _visit(
        self, x: ca.MX, along: ca.MX, fraction: float, h: ca.MX, *, reach: float, weight: float
    ) -> tuple[_Visit, ca.MX, ca.MX]:
        """Return a slope's place, h times the slope, and d(that)/dw."""
        g = self.given
        p = g["p0"] + fraction * (g["p1"] - g["p0"])
        at = (x, g["u"], g["t"] + fraction * g["h"], p)
        slope, jacobian = self.slope.first.call(list(at))
        jacobian = h * jacobian
        from_u = ca.horzcat(ca.MX.zeros(self.nx + 1, self.nx), jacobian[:, self.nx :])
        rise = jacobian[:, : self.nx] @ along + from_u
        return _Visit(at, jacobian, along, reach, weight, h), h * slope, rise

    def outputs(self) -> list[ca.MX]:
        """Return state, cost, Jacobian, slope and Hessian, the last by going backwards."""
        costate = self.given["costate"]
        slope = self.gradient.T + self.along.T @ costate
        hessian = ca.MX.zeros(self.nx + self.nu, self.nx + self.nu)
        for visits in reversed(self.substeps):
            before = costate
            pull = ca.MX.zeros(self.nx)  # of the slope behind on this one
            for visit in reversed(visits):
                weight = ca.vertcat(visit.weight * costate + pull, visit.weight)
                hessian += self._bend(visit, visit.step * weight)
                back = visit.jacobian[:, : self.nx].T @ weight
                before, pull = before + back, visit.reach * back
            costate = before
        return [self.x, self.cost, self.along, slope, hessian]

    def _bend(self, visit: _Visit, weight: ca.MX) -> ca.MX:
        """Return Z' H Z of one slope, Z = (dx_i/dw; du/dw)."""
        nx, bend = self.nx, self.slope.second(*visit.at, weight)
        moved = bend[:, :nx] @ visit.along
        mixed = ca.vertcat(ca.MX.zeros(nx, nx + self.nu), moved[nx:, :])
        own = ca.diagcat(ca.MX(nx, nx), bend[nx:, nx:])
        return visit.along.T @ moved[:nx, :] + mixed + mixed.T + own
