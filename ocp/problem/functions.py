"""A problem as CasADi Functions: numbers in, numbers out."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import casadi as ca

from ocp.problem.constraint import Constraint, Place
from ocp.problem.measurement import Measurement
from ocp.problem.model import Model
from ocp.problem.peak import Peak


@dataclass(frozen=True, eq=False)
class Functions:
    """Everything a problem says, as Functions of (x, u, t, p) or, at the ends, of (x, t, p).

    They take symbols as well as numbers, to build from; to call one again and again with arrays,
    see ``BufferedFunction``.

    Attributes:
        rate: f (nx,).
        running_cost: L.
        terminal_cost: phi.
        terminal_gradient: phi_x (nx,).
        terminal_slopes: phi_t, psi_x (m, nx) and psi_t (m,).
        path: path constraints, stacked.
        initial: initial constraints c, stacked.
        initial_slope: c_x (m, nx).
        terminal: terminal constraints psi, stacked.
        instants: constraints at instants, stacked.
        integrands: of the integral constraints, stacked.
        invariants: invariants, stacked; of (x, t, p).
        algebraic: the algebraic variables (nz,).
        measured: what is measured, stacked; of (x, t, p).
        peaks: what the largest values are taken of, stacked.
    """

    rate: ca.Function
    running_cost: ca.Function
    terminal_cost: ca.Function
    terminal_gradient: ca.Function
    terminal_slopes: ca.Function
    path: ca.Function
    initial: ca.Function
    initial_slope: ca.Function
    terminal: ca.Function
    instants: ca.Function
    integrands: ca.Function
    invariants: ca.Function
    algebraic: ca.Function
    measured: ca.Function
    peaks: ca.Function

    @classmethod
    def of(
        cls,
        model: Model,
        p: ca.SX,
        *,
        running_cost: ca.SX,
        terminal_cost: ca.SX,
        constraints: Sequence[Constraint],
        invariants: Sequence[Constraint],
        algebraic: ca.SX,
        data: Sequence[Measurement],
        peaks: Sequence[Peak],
    ) -> "Functions":
        """Build them from the parts of a problem without algebraic variables, and those.

        p are all parameters and signals (n_p,).
        """
        m, phi = model, terminal_cost

        def at(place: Place) -> ca.SX:
            return stacked(c for c in constraints if c.at == place)

        def along(name: str, expression: ca.SX) -> ca.Function:
            return ca.Function(name, [m.x, m.u, m.t, p], [expression], ["x", "u", "t", "p"], [name])

        def at_an_end(name: str, *expressions: ca.SX) -> ca.Function:
            return ca.Function(name, [m.x, m.t, p], [ca.densify(e) for e in expressions])

        c, psi = at("initial"), at("terminal")
        slopes = (ca.gradient(phi, m.t), ca.jacobian(psi, m.x), ca.jacobian(psi, m.t))
        return cls(
            rate=along("rate", m.f),
            running_cost=along("running_cost", running_cost),
            terminal_cost=at_an_end("terminal_cost", phi),
            terminal_gradient=at_an_end("terminal_gradient", ca.gradient(phi, m.x)),
            terminal_slopes=at_an_end("terminal_slopes", *slopes),
            path=along("path", at("path")),
            initial=at_an_end("initial", c),
            initial_slope=at_an_end("initial_slope", ca.jacobian(c, m.x)),
            terminal=at_an_end("terminal", psi),
            instants=at_an_end("instants", at("instants")),
            integrands=along("integrands", at("integral")),
            invariants=at_an_end("invariants", stacked(invariants)),
            algebraic=along("algebraic", algebraic),
            measured=at_an_end("measured", stacked(data)),
            peaks=along("peaks", stacked(peaks)),
        )

    @cached_property
    def called(self) -> tuple[ca.Function, ...]:
        """What expressions call instead of writing it out: tables, external functions, callbacks.

        Each once, with what they call themselves, and derivatives that occur.
        """
        own = (getattr(self, field.name) for field in fields(self))
        found = {hash(each): each for function in own for each in function.find_functions()}
        return tuple(found.values())


def stacked(constraints: Iterable[Constraint | Measurement | Peak]) -> ca.SX:
    """Return the expressions of several constraints, measurements or peaks as one column."""
    return ca.vertcat(ca.SX(0, 1), *[c.expression for c in constraints])
