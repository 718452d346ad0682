"""The minimum principle on arcs, in symbols: controls, rates, junctions, the end."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from ocp import OCP, Solution
from ocp.internal import hamiltonian
from solvers.certify.control_arcs import Arc, NoArcsError


@dataclass(frozen=True, eq=False)
class ArcConditions:
    r"""What holds on arcs, each with its own control, and between them.

    On arc i the laws decide some controls, and H_u = 0 the others, so that u = u_i(x, λ, t) and

    .. math::

        \dot x = f(x, u_i), \quad \dot\lambda = -\partial_x \, H(x, u_i(x, \lambda, t), \lambda, t)

    where the derivative goes through the laws: that is the multiplier of what is active. Where
    control j enters or leaves a law

    .. math:: H_{u_j} = 0 \quad \text{with the control as the law has it,}

    at the end ψ = 0, λ = φ_x + ψ_x'ν, and either the durations make up the horizon or
    H + φ_t + ν'ψ_t = 0. Source: [Bryson & Ho 1975, 3.8 and 3.9].

    Attributes:
        start: the problem and its data.
        arcs: in order.
        controls: u_i(x, λ, t) of each arc.
        junctions: H_u of the control that changes its law, from arc to arc, of (z, t).
    """

    start: Solution
    arcs: tuple[Arc, ...]
    controls: list[ca.SX]
    junctions: list[ca.Function]

    @classmethod
    def of(cls, start: Solution, arcs: tuple[Arc, ...]) -> "ArcConditions":
        """Derive the conditions.

        Raises:
            NoArcsError: for what these equations do not cover.
        """
        ocp = start.problem
        if ocp.moving:
            raise NoArcsError("signals are not looked at")
        if ocp.has_free_start:
            raise NoArcsError("the start is free")
        if not all(c.is_equation for c in ocp.at("terminal")):
            raise NoArcsError("an inequality at the end")
        controls = [_control(ocp, arc) for arc in arcs]
        return cls(start, arcs, controls, _junctions(start, arcs, controls))

    @property
    def _costate(self) -> ca.SX:
        return hamiltonian(self.start.problem).expressions.costate

    @property
    def _hamiltonian(self) -> ca.SX:
        return _hamiltonian(self.start.problem)

    def function(self, expressions: Sequence[ca.SX]) -> ca.Function:
        """Expressions as a Function of (z, t), z state and costate."""
        return _function(self.start, expressions)

    @cached_property
    def rates(self) -> list[ca.Function]:
        """Of state and costate on each arc."""
        m = self.start.problem.model
        return [
            self.function(
                [
                    ca.vertcat(
                        ca.substitute(m.f, m.u, u),
                        -ca.gradient(ca.substitute(self._hamiltonian, m.u, u), m.x),
                    )
                ]
            )
            for u in self.controls
        ]

    @cached_property
    def law_multipliers(self) -> list[ca.Function]:
        """On each arc: H_u against the laws, not positive where multipliers have their signs."""
        m, found = self.start.problem.model, []
        slopes = ca.vertsplit(ca.gradient(self._hamiltonian, m.u))
        for arc, u in zip(self.arcs, self.controls, strict=True):
            held = [law.push * s for law, s in zip(arc.laws, slopes, strict=True) if law]
            found.append(self.function([ca.substitute(ca.vertcat(ca.SX(0, 1), *held), m.u, u)]))
        return found

    @cached_property
    def psi(self) -> ca.SX:
        """The terminal equations."""
        ends = self.start.problem.at("terminal")
        return ca.vertcat(ca.SX(0, 1), *[c.expression - ca.DM(np.asarray(c.lower)) for c in ends])

    @cached_property
    def ends(self) -> ca.Function:
        """φ_x and ψ_x, of (z, t)."""
        ocp = self.start.problem
        cost = ca.gradient(ca.SX(ocp.terminal_cost), ocp.model.x)
        return self.function([cost, ca.jacobian(self.psi, ocp.model.x)])

    @cached_property
    def end(self) -> ca.Function:
        """What holds at the final time, of (z, t, ν, durations)."""
        psi = self.psi
        ocp, lengths = self.start.problem, ca.SX.sym("lengths", len(self.arcs))
        m, nu = ocp.model, ca.SX.sym("nu", psi.numel())
        end = ca.SX(ocp.terminal_cost) + ca.dot(nu, psi)
        if ocp.has_free_time:
            value = ca.substitute(self._hamiltonian, m.u, self.controls[-1])
            last = value + ca.gradient(end, m.t)
        else:
            last = ca.sum1(lengths) - ocp.duration
        rows = ca.vertcat(psi, self._costate - ca.gradient(end, m.x), last)
        rows = ca.substitute(rows, ocp.p, ca.SX(self.start.data.values.at(0.0)[0]))
        return ca.Function("end", [_z(ocp), m.t, nu, lengths], [rows])


def _hamiltonian(ocp: OCP) -> ca.SX:
    return ocp.running_cost + ca.dot(hamiltonian(ocp).expressions.costate, ocp.model.f)


def _z(ocp: OCP) -> ca.SX:
    """State and costate."""
    return ca.vertcat(ocp.model.x, hamiltonian(ocp).expressions.costate)


def _function(start: Solution, expressions: Sequence[ca.SX]) -> ca.Function:
    """Expressions as a Function of (z, t), with the parameters of a run."""
    ocp = start.problem
    p = ca.SX(start.data.values.at(0.0)[0])
    values = ca.substitute(list(expressions), [ocp.p], [p])
    return ca.Function("at", [_z(ocp), ocp.model.t], values)


def _control(ocp: OCP, arc: Arc) -> ca.SX:
    """u_i(x, λ, t) of an arc."""
    m = ocp.model
    symbols, u = ca.vertsplit(m.u), m.u
    for symbol, law in zip(symbols, arc.laws, strict=True):
        u = ca.substitute(u, symbol, law.value) if law else u
    free = [s for s, law in zip(symbols, arc.laws, strict=True) if law is None]
    if not free:
        return u
    chosen = ca.vertcat(*free)
    slope = ca.gradient(ca.substitute(_hamiltonian(ocp), m.u, u), chosen)
    curvature = ca.jacobian(slope, chosen)
    if ca.depends_on(curvature, chosen) or ca.sprank(curvature) < len(free):
        names = ", ".join(str(s) for s in free)
        raise NoArcsError(f"H is not quadratic in {names} where no bound is met")
    best = -ca.solve(curvature, ca.substitute(slope, chosen, ca.SX.zeros(len(free))))
    return ca.substitute(u, chosen, best)


def _junctions(start: Solution, arcs: tuple[Arc, ...], controls: list[ca.SX]) -> list[ca.Function]:
    """H_u of the control that changes its law, from arc to arc, of (z, t)."""
    m, found = start.problem.model, []
    slope = ca.gradient(_hamiltonian(start.problem), m.u)
    for k, (one, other) in enumerate(pairwise(arcs)):
        pairs = zip(one.names, other.names, strict=True)
        changed = [j for j, (a, b) in enumerate(pairs) if a != b]
        if len(changed) != 1:
            raise NoArcsError("two controls switch at once")
        (j,) = changed
        laws = one.laws[j], other.laws[j]
        if all(laws) and any(law.row is not None for law in laws if law):
            raise NoArcsError("a control goes from a bound right to a path constraint")
        bound = controls[k if laws[0] else k + 1]
        found.append(_function(start, [ca.substitute(slope[j], m.u, bound)]))
    return found
