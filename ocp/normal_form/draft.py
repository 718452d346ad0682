"""A problem while it is rewritten: its own states and controls, and what is added behind them.

A control may become a state: it keeps its symbol, so that no expression changes.
"""

from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from ocp.checks.expressions import element_names
from ocp.normal_form.origin import Origin
from ocp.problem.constraint import Box, Constraint, unused
from ocp.problem.model import Model
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Steps
from ocp.problem.scaled import sizes_of


@dataclass(frozen=True, eq=False)
class AddedStates:
    """States behind those of a problem.

    Attributes:
        symbol: (m,).
        rate: of them (m,), or in discrete time the next ones.
        start: where they start, or a guess of it (m,).
        is_free: whether the optimiser chooses the start.
        box: bounds of the start, each (m,).
        size: typical sizes (m,).
        bounds: all along the way; None: none.
    """

    symbol: ca.SX
    rate: ca.SX
    start: np.ndarray
    is_free: bool
    box: Box
    size: np.ndarray
    bounds: Box | None = None

    @classmethod
    def constant(
        cls,
        ocp: OCP,
        symbol: ca.SX,
        value: np.ndarray,
        *,
        size: np.ndarray,
        box: Box | None = None,
    ) -> "AddedStates":
        """Return states that never change: a constant that the optimiser chooses.

        Its box holds at the start alone. At all nodes one bound would be many, and its multiplier
        spread over them.
        """
        count = symbol.numel()
        rate = symbol if ocp.model.is_discrete else ca.SX.zeros(count)
        box = Box.unbounded(count) if box is None else box
        return cls(symbol, rate, value, True, box, size)


@dataclass(frozen=True, eq=False)
class AddedControls:
    """Controls behind those of a problem.

    Attributes:
        symbol: (m,).
        box: their bounds, each (m,).
        size: typical sizes (m,).
    """

    symbol: ca.SX
    box: Box
    size: np.ndarray


@dataclass(eq=False)
class Draft:
    """A problem and its changes so far.

    Attributes:
        ocp: as it was written.
        f: right-hand side of its own states.
        running_cost: of the rewritten problem.
        terminal_cost: of it.
        constraints: of it.
        smoothness: of it.
        states: added ones.
        controls: added ones.
        moved: controls of its own that are states now: where each one stands among all states.
        steps: added constants of the problem.
        origins: what added names stand for.
    """

    ocp: OCP
    f: ca.SX
    running_cost: ca.SX
    terminal_cost: ca.SX
    constraints: list[Constraint]
    smoothness: int
    states: list[AddedStates] = field(default_factory=list)
    controls: list[AddedControls] = field(default_factory=list)
    moved: dict[int, int] = field(default_factory=dict)
    steps: list[Steps] = field(default_factory=list)
    origins: dict[str, Origin] = field(default_factory=dict)

    @classmethod
    def of(cls, ocp: OCP) -> "Draft":
        """Begin with a problem as it was written."""
        costs = ca.SX(ocp.running_cost), ca.SX(ocp.terminal_cost)
        return cls(ocp, ocp.model.f, *costs, list(ocp.constraints), ocp.smoothness)

    def unused(self, name: str, origin: Origin) -> str:
        """Return a name that no constraint has, for one that stands for ``origin``."""
        name = unused(name, {c.name for c in (*self.constraints, *self.ocp.invariants)})
        self.origins[name] = origin
        return name

    def add_states(self, added: AddedStates, *origins: Origin) -> slice:
        """Add states, and return where they stand among all.

        Args:
            added: the states.
            origins: what each of them stands for, or one for all; none: for itself.
        """
        first = self.ocp.model.nx + sum(s.symbol.numel() for s in self.states)
        self.states.append(added)
        self._note(added.symbol, origins)
        return slice(first, first + added.symbol.numel())

    def add_controls(self, added: AddedControls, *origins: Origin) -> None:
        """Add controls, see ``add_states``."""
        self.controls.append(added)
        self._note(added.symbol, origins)

    def _note(self, symbol: ca.SX, origins: tuple[Origin, ...]) -> None:
        names = element_names(symbol) if origins else ()
        each = origins * len(names) if len(origins) == 1 else origins
        self.origins |= dict(zip(names, each, strict=True))

    @property
    def kept(self) -> list[int]:
        """Which controls of the problem are controls still."""
        return [i for i in range(self.ocp.model.nu) if i not in self.moved]

    def own_controls(self) -> np.ndarray:
        """Return where the problem's controls stand among all states and controls, (nu,)."""
        nx = self.ocp.model.nx + sum(s.symbol.numel() for s in self.states)
        at = {i: nx + k for k, i in enumerate(self.kept)} | self.moved
        return np.array([at[i] for i in range(self.ocp.model.nu)], dtype=int)

    def add_steps(self, name: str, symbol: ca.SX, inner: np.ndarray, value: np.ndarray) -> None:
        """Add a constant (m,) that steps at instants, see ``Steps``."""
        taken = {entry.name for entry in (*self.ocp.parameters, *self.ocp.unknowns, *self.steps)}
        self.steps.append(Steps(unused(name, taken), symbol, inner, value))

    def problem(self) -> OCP:
        """Return the rewritten problem."""
        ocp, m = self.ocp, self.ocp.model
        own = [name for name, free in zip(m.x_names, ocp.start_is_free, strict=True) if free]
        added = [str(e) for s in self.states if s.is_free for e in ca.vertsplit(s.symbol)]
        start, states, controls = ocp.start_bounds, ocp.state_bounds, ocp.control_bounds[self.kept]
        for s in self.states:
            start = start & s.box
            states = states & (s.bounds or Box.unbounded(s.symbol.numel()))
        for c in self.controls:
            controls = controls & c.box
        return replace(
            ocp,
            model=self._model(),
            x0=np.concatenate([ocp.start(), *[s.start for s in self.states]]),
            running_cost=self.running_cost,
            terminal_cost=self.terminal_cost,
            control_bounds=controls,
            state_bounds=states,
            constraints=tuple(self.constraints),
            free_start=(*own, *added),
            start_bounds=start,
            parameters=(*ocp.parameters, *self.steps),
            unknowns=(),
            rates=(),
            peaks=(),
            last_input=None,
            data=(),
            delays=(),
            smoothness=self.smoothness,
            guess=None,
        )

    def _model(self) -> Model:
        m, sizes, kept = self.ocp.model, sizes_of(self.ocp), self.kept
        states, controls = [s.symbol for s in self.states], [c.symbol for c in self.controls]
        more_x, more_u = (sum(s.numel() for s in each) for each in (states, controls))
        return replace(
            m,
            x=ca.vertcat(m.x, *states),
            u=ca.vertcat(m.u[kept, :], *controls),
            f=ca.vertcat(self.f, *[s.rate for s in self.states]),
            x_units=(*m.x_units, *[""] * more_x) if m.x_units else (),
            u_units=(*(m.u_units[i] for i in kept), *[""] * more_u) if m.u_units else (),
            x_nominal=np.concatenate([sizes.x, *[s.size for s in self.states]]),
            u_nominal=np.concatenate([sizes.u[kept], *[c.size for c in self.controls]]),
            start=ca.SX(),
        )
