"""The dynamics of a problem: symbols, right-hand side, names and units."""

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_instance, check_nominal, check_positive
from ocp.checks.errors import ProblemError
from ocp.checks.expressions import (
    Expression,
    check_column,
    check_symbols,
    element_names,
    refuse_foreign_symbols,
)
from ocp.checks.rich_text import counted
from ocp.problem.portable import Portable

# More names than so many are counted.
_FEW = 6


@dataclass(frozen=True, eq=False, kw_only=True)
class Model(Portable):
    r"""A dynamic model, continuous or discrete in time.

    .. math:: \dot x = f(x, u, t) \quad (\text{dt is None}), \qquad
              x_{k+1} = f(x_k, u_k, t_k) \quad (\text{dt a number})

    With algebraic variables z, f is of them too, and 0 = g(x, u, z, t) at all times. The index is
    1: g determines z. Source: thesis (1.1) and (1.6).

    Args:
        name: what people call it.
        x: state symbols, an ``SX`` column (nx,). All terms of a problem may be written in ``MX``
            as well: every symbol of MX is the same one of SX in all of them.
        u: control symbols, an ``SX`` column (nu,).
        f: right-hand side (nx,), an expression in x, u, t and the problem's parameters.
        t: the symbol of time [s], needed only where ``f`` or a cost depends on time.
        dt: step of a discrete-time model [s]; ``None``: ``f`` is dx/dt.
        x_units: a unit for each state, for plots and messages.
        u_units: a unit for each control.
        x_nominal: a typical size of each state, a number or (nx,), for solvers to measure it by;
            None: they estimate it, see ``Solution.sizes``.
        u_nominal: the same of the controls (nu,).
        start: symbols of the state at the start (nx,), for costs and constraints that couple both
            ends of a trajectory, such as ``x - model.start`` at the end of a period; they are made
            by the model.
        z: symbols of algebraic variables, an ``SX`` column (nz,), for f, costs and constraints.
        algebraic: g, which is zero (nz,).
        z_guess: where a root of g is looked for, numbers (nz,) or an expression in x, u, t and
            parameters; needed where g is not linear in z. Of several roots it says which is meant.
        z_units: a unit for each algebraic variable.

    Raises:
        ProblemError: naming the symbol and the shape that are wrong.
    """

    name: str
    x: ca.SX
    u: ca.SX
    f: ca.SX
    t: ca.SX = field(default_factory=lambda: ca.SX.sym("t"))
    dt: float | None = None
    x_units: tuple[str, ...] = ()
    u_units: tuple[str, ...] = ()
    x_nominal: ArrayLike | None = None
    u_nominal: ArrayLike | None = None
    z: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    algebraic: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    z_guess: Expression | None = None
    z_units: tuple[str, ...] = ()
    start: ca.SX = field(default_factory=ca.SX)

    def __post_init__(self) -> None:
        """Check every shape and symbol."""
        check_instance(self.name, str, "the name of a model")
        for label in ("x", "u", "t", "z"):
            symbols = check_symbols(getattr(self, label), f"model '{self.name}': {label}")
            object.__setattr__(self, label, symbols)
        if self.t.numel() != 1:
            raise ProblemError(
                f"model '{self.name}': t has shape {self.t.shape}, it must be (1, 1)"
            )
        f = check_column(self.f, f"model '{self.name}': f")
        if f.numel() != self.nx:
            raise ProblemError(
                f"model '{self.name}': f has {f.numel()} rows, but there are {self.nx} states x"
            )
        object.__setattr__(self, "f", f)
        self._check_algebraic()
        if self.start.numel() != self.nx:  # none yet, or those of a model with other states
            named = [ca.SX.sym(f"{name}(t0)") for name in self.x_names]
            object.__setattr__(self, "start", ca.vertcat(ca.SX(0, 1), *named))
        if self.dt is not None:
            check_positive(self.dt, f"model '{self.name}': dt")
        for label in ("x", "u", "z"):
            units, size = getattr(self, f"{label}_units"), getattr(self, label).numel()
            check_instance(units, (tuple, list), f"model '{self.name}': {label}_units")
            if units and len(units) != size:
                raise ProblemError(
                    f"model '{self.name}': {label}_units has {len(units)} entries "
                    f"for {size} symbols"
                )
        for label, size in (("x_nominal", self.nx), ("u_nominal", self.nu)):
            what = f"model '{self.name}': {label}"
            object.__setattr__(self, label, check_nominal(getattr(self, label), size, what))

    def __repr__(self) -> str:
        """Return one line: what moves, and what moves it."""
        sizes = ", ".join(
            f"{counted(len(names), what)} ({', '.join(names)})"
            for names, what in (
                (self.x_names, "state"),
                (self.u_names, "control"),
                (self.z_names, "algebraic variable"),
            )
            if names and len(names) <= _FEW
        ) or counted(self.nx, "state") + ", " + counted(self.nu, "control")
        step = f", dt = {self.dt:g} s" if self.dt is not None else ""
        return f"<Model '{self.name}': {sizes}{step}>"

    def _check_algebraic(self) -> None:
        """Check the algebraic equations and where their root is looked for."""
        g = check_column(self.algebraic, f"model '{self.name}': algebraic")
        if g.numel() != self.nz:
            raise ProblemError(
                f"model '{self.name}': algebraic has {g.numel()} rows, but there are {self.nz} "
                "algebraic variables z; each needs an equation"
            )
        object.__setattr__(self, "algebraic", g)
        if self.z_guess is None:
            return
        guess = check_column(self.z_guess, f"model '{self.name}': z_guess")
        if guess.numel() != self.nz:
            raise ProblemError(
                f"model '{self.name}': z_guess has {guess.numel()} rows, but there are {self.nz} "
                "algebraic variables z"
            )
        if not all(e.is_regular() for e in ca.vertsplit(guess) if e.is_constant()):
            raise ProblemError(f"model '{self.name}': z_guess = {guess} is not finite")
        object.__setattr__(self, "z_guess", guess)

    @cached_property
    def nx(self) -> int:
        """Number of states."""
        return self.x.numel()

    @cached_property
    def nu(self) -> int:
        """Number of controls."""
        return self.u.numel()

    @cached_property
    def nz(self) -> int:
        """Number of algebraic variables."""
        return self.z.numel()

    @property
    def z_start(self) -> ca.SX:
        """Where a root of g is looked for (nz,); 0 where it does not matter."""
        if self.z_guess is None:
            return ca.SX.zeros(self.nz)
        return check_column(self.z_guess, f"model '{self.name}': z_guess")

    @property
    def is_discrete(self) -> bool:
        """Whether ``f`` is the next state instead of the rate."""
        return self.dt is not None

    @property
    def x_names(self) -> tuple[str, ...]:
        """Names of the states, read off the symbols."""
        return element_names(self.x)

    @property
    def u_names(self) -> tuple[str, ...]:
        """Names of the controls, read off the symbols."""
        return element_names(self.u)

    @property
    def z_names(self) -> tuple[str, ...]:
        """Names of the algebraic variables, read off the symbols."""
        return element_names(self.z)

    def refuse_foreign_symbols(self, parameters: ca.SX) -> None:
        """Raise ``ProblemError`` if an expression has a symbol that is declared nowhere."""
        known = [self.x, self.u, self.t, parameters]
        refuse_foreign_symbols(self.f, [*known, self.z], f"model '{self.name}': f")
        refuse_foreign_symbols(self.algebraic, [*known, self.z], f"model '{self.name}': algebraic")
        if self.nz:
            refuse_foreign_symbols(self.z_start, known, f"model '{self.name}': z_guess")
