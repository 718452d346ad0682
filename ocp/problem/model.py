"""The dynamics of a problem: symbols, right-hand side, names and units."""

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_flag, check_instance, check_nominal, check_positive
from ocp.checks.errors import ProblemError
from ocp.checks.expressions import (
    check_column,
    check_symbols,
    element_names,
    refuse_foreign_symbols,
)
from ocp.problem.portable import Portable


@dataclass(frozen=True, eq=False, kw_only=True)
class Model(Portable):
    r"""A dynamic model, continuous or discrete in time.

    .. math:: \dot x = f(x, u, t) \quad (\text{dt is None}), \qquad
              x_{k+1} = f(x_k, u_k, t_k) \quad (\text{dt a number})

    Source: thesis (1.1) and (1.6).

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
        u_is_change: whether the controls are changes of what an actuator holds, see
            ``with_input_rate``: to hold is then to send zero.

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
    u_is_change: bool = False
    start: ca.SX = field(default_factory=ca.SX)

    def __post_init__(self) -> None:
        """Check every shape and symbol."""
        check_instance(self.name, str, "the name of a model")
        for label in ("x", "u", "t"):
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
        if self.start.numel() != self.nx:  # none yet, or those of a model with other states
            named = [ca.SX.sym(f"{name}(t0)") for name in self.x_names]
            object.__setattr__(self, "start", ca.vertcat(ca.SX(0, 1), *named))
        if self.dt is not None:
            check_positive(self.dt, f"model '{self.name}': dt")
        for label, units, size in (("x", self.x_units, self.nx), ("u", self.u_units, self.nu)):
            check_instance(units, (tuple, list), f"model '{self.name}': {label}_units")
            if units and len(units) != size:
                raise ProblemError(
                    f"model '{self.name}': {label}_units has {len(units)} entries "
                    f"for {size} symbols"
                )
        check_flag(self.u_is_change, f"model '{self.name}': u_is_change")
        for label, size in (("x_nominal", self.nx), ("u_nominal", self.nu)):
            what = f"model '{self.name}': {label}"
            object.__setattr__(self, label, check_nominal(getattr(self, label), size, what))

    @cached_property
    def nx(self) -> int:
        """Number of states."""
        return self.x.numel()

    @cached_property
    def nu(self) -> int:
        """Number of controls."""
        return self.u.numel()

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

    def refuse_foreign_symbols(self, parameters: ca.SX) -> None:
        """Raise ``ProblemError`` if ``f`` has a symbol that is no x, u, t or parameter."""
        allowed = [self.x, self.u, self.t, parameters]
        refuse_foreign_symbols(self.f, allowed, f"model '{self.name}': f")
