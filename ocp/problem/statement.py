"""What a user states of an optimal control problem, and what follows from the words alone."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_instance, check_numbers, check_positive
from ocp.checks.errors import ProblemError
from ocp.checks.expressions import check_scalar
from ocp.problem.constraint import Box, Constraint, Place, check_place
from ocp.problem.delay import Delay
from ocp.problem.free_time import FreeTime
from ocp.problem.guess import Guess, check_guess
from ocp.problem.measurement import Measurement
from ocp.problem.model import Model
from ocp.problem.parameters import (
    Entry,
    Parameter,
    PastInput,
    Signal,
    StartValue,
    Steps,
    Unknown,
)
from ocp.problem.peak import Peak
from ocp.problem.portable import Portable
from ocp.problem.rate import ControlRates, Rate


@dataclass(frozen=True, eq=False, kw_only=True)
class Statement(Portable):
    """The parts of an ``OCP``, each of its kind and size; there they are explained.

    Raises:
        ProblemError: naming a part that is of another kind, or of another size.
    """

    name: str
    model: Model
    x0: ArrayLike
    horizon: float | int | FreeTime
    running_cost: ca.SX | float = 0.0
    terminal_cost: ca.SX | float = 0.0
    control_bounds: Box = field(default_factory=Box)
    state_bounds: Box = field(default_factory=Box)
    constraints: tuple[Constraint, ...] = ()
    free_start: tuple[str, ...] = ()
    start_bounds: Box = field(default_factory=Box)
    invariants: tuple[Constraint, ...] = ()
    parameters: tuple[Parameter | Signal | Steps, ...] = ()
    unknowns: tuple[Unknown, ...] = ()
    peaks: tuple[Peak, ...] = ()
    rates: tuple[Rate, ...] = ()
    last_input: ArrayLike | None = None
    data: tuple[Measurement, ...] = ()
    delays: tuple[Delay, ...] = ()
    smoothness: Literal[0, 1, 2] = 2
    guess: Guess | None = None

    def __post_init__(self) -> None:
        """Check kinds and sizes, and stack what was given loosely."""
        self._check_kinds()
        sized = {
            "x0": check_numbers(self.x0, self.model.nx, f"{self.name}: x0"),
            "running_cost": check_scalar(self.running_cost, f"{self.name}: running_cost"),
            "terminal_cost": check_scalar(self.terminal_cost, f"{self.name}: terminal_cost"),
        }
        for part, size in (
            ("control_bounds", self.model.nu),
            ("state_bounds", self.model.nx),
            ("start_bounds", self.model.nx),
        ):
            sized[part] = getattr(self, part).sized(size, f"{self.name}: {part}")
        for part, value in sized.items():
            object.__setattr__(self, part, value)
        self._check_horizon()

    @property
    def p(self) -> ca.SX:
        """Symbols of all that a run gives, or the optimiser chooses once, stacked (n_p,)."""
        return ca.vertcat(ca.SX(0, 1), *[entry.symbol for entry in self.entries])

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """What stands in p: parameters and signals, last input, unknown constants, the start."""
        start = (StartValue(self.model.start, self.start()),) if self.refers_to_start else ()
        return (*self.given, *self.unknowns, *start)

    @property
    def moving(self) -> tuple[Signal | Steps, ...]:
        """The parameters that change along the horizon."""
        return tuple(e for e in self.parameters if isinstance(e, Signal | Steps))

    @cached_property
    def given(self) -> tuple[Parameter | Signal | Steps | PastInput, ...]:
        """What a run gives by name: parameters and signals, and what was sent before it."""
        known = (*self.parameters, *(delay.entry() for delay in self.delays))
        if self.last_input is None:
            return known
        names = [self.model.u_names[i] for i in self.control_rates.index]
        last = ca.vertcat(*[ca.SX.sym(f"last {name}") for name in names])
        return (*known, PastInput(last, np.asarray(self.last_input), "last_input"))

    @cached_property
    def control_rates(self) -> ControlRates:
        """The rates, stacked in the order of the controls."""
        return ControlRates.of(self.name, self.model, self.rates)

    @property
    def refers_to_start(self) -> bool:
        """Whether a term contains the state at the start."""
        return bool(self.used_of_start)

    @cached_property
    def used_of_start(self) -> tuple[int, ...]:
        """Which components of the state at the start terms contain."""
        written = [
            *(e for e in (self.running_cost, self.terminal_cost) if isinstance(e, ca.SX)),
            *(c.expression for c in (*self.constraints, *self.invariants, *self.peaks)),
            self.model.f,
            self.model.algebraic,
        ]
        found = {s.element_hash() for s in ca.symvar(ca.veccat(*written))}
        start = ca.vertsplit(self.model.start)
        return tuple(i for i, symbol in enumerate(start) if symbol.element_hash() in found)

    @property
    def has_free_time(self) -> bool:
        """Whether the final time is an unknown."""
        return isinstance(self.horizon, FreeTime)

    @cached_property
    def start_is_free(self) -> np.ndarray:
        """Which states start where the optimiser chooses, bool (nx,)."""
        if self.free_start:
            return np.array([name in self.free_start for name in self.model.x_names], dtype=bool)
        on_manifold = any(c.at == "initial" for c in self.constraints)
        return np.full(self.model.nx, on_manifold)

    @property
    def has_free_start(self) -> bool:
        """Whether any part of the start is an unknown."""
        return bool(self.start_is_free.any())

    @cached_property
    def start_box(self) -> Box:
        """Bounds of x(t0): those of the states and of the start; none where the start is given."""
        free, states, own = self.start_is_free, self.state_bounds, self.start_bounds
        return Box(
            np.where(free, np.maximum(states.lower, own.lower), -np.inf),
            np.where(free, np.minimum(states.upper, own.upper), np.inf),
        )

    def start_of(self, x0: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return a start (nx,): what is given of it from ``x0``, what is free from ``x``."""
        return np.where(self.start_is_free, x, x0)

    @property
    def duration(self) -> float:
        """Final time minus t0 [s]; where it is free, its guess."""
        if isinstance(self.horizon, FreeTime):
            return self.horizon.guess
        return float(self.horizon) * (self.model.dt or 1.0)

    @property
    def time_box(self) -> Box:
        """Bounds of the duration [s]; a fixed one has equal bounds."""
        if isinstance(self.horizon, FreeTime):
            return Box([self.horizon.lower], [self.horizon.upper])
        return Box([self.duration], [self.duration])

    @property
    def steps(self) -> int | None:
        """Number of steps of a discrete-time problem, else None."""
        if isinstance(self.horizon, FreeTime) or not self.model.is_discrete:
            return None
        return int(self.horizon)

    def at(self, place: Place) -> tuple[Constraint, ...]:
        """Return the constraints of one place."""
        check_place(place, f"{self.name}: the place of constraints")
        return tuple(c for c in self.constraints if c.at == place)

    def terms(self, rewritten: Callable[[ca.SX | float], ca.SX]) -> dict[str, Any]:
        """Return costs and all that has an expression with every one rewritten."""

        def each(parts: Iterable[Constraint | Peak | Measurement]) -> tuple[Any, ...]:
            return tuple(replace(part, expression=rewritten(part.expression)) for part in parts)

        return {
            "running_cost": rewritten(self.running_cost),
            "terminal_cost": rewritten(self.terminal_cost),
            "constraints": each(self.constraints),
            "invariants": each(self.invariants),
            "peaks": each(self.peaks),
            "data": each(self.data),
        }

    def start(self, x0: ArrayLike | None = None) -> np.ndarray:
        """Return the start of a run (nx,), checked; the declared one unless given.

        A start that is given may lie outside the state bounds: it is what it is, such as a
        measured state, and no solver can change it. What that means the solution says.
        """
        return check_numbers(self.x0 if x0 is None else x0, self.model.nx, f"{self.name}: x0")

    def first_guess(self, given: Any = None) -> Any:
        """Return where a run starts, checked: what is given, else the problem's guess, or None.

        Raises:
            ProblemError: if it is nothing that can be sampled.
        """
        guess = self.guess if given is None else given
        check_guess(self.name, guess, self.unknowns)
        return guess

    def expressions(self) -> list[ca.SX]:
        """Return all expressions: its own, of the model and of the constraints."""
        parts = (self.model, *self.constraints, *self.invariants, *self.peaks, *self.data)
        return [*super().expressions(), *(e for part in parts for e in part.expressions())]

    def first_controls(self) -> list[np.ndarray]:
        """Return the controls with which solvers may start: of the guess or the bounds, and 0."""
        given = self.guess.sample("u", np.array([0.0]), self.model.nu) if self.guess else None
        zero = self.control_bounds.clip(np.zeros(self.model.nu))
        return [self.control_bounds.inside() if given is None else given[0], zero]

    # -- checks of kinds ------------------------------------------------------------

    def _check_kinds(self) -> None:
        check_instance(self.name, str, "the name of a problem")
        check_instance(self.model, Model, f"{self.name}: model")
        check_instance(self.control_bounds, Box, f"{self.name}: control_bounds")
        check_instance(self.state_bounds, Box, f"{self.name}: state_bounds")
        check_instance(self.start_bounds, Box, f"{self.name}: start_bounds")
        self.first_guess()
        for what, kind in (
            ("constraints", Constraint),
            ("invariants", Constraint),
            ("parameters", (Parameter, Signal, Steps)),
            ("unknowns", Unknown),
            ("peaks", Peak),
            ("rates", Rate),
            ("data", Measurement),
            ("delays", Delay),
        ):
            entries = getattr(self, what)
            check_instance(entries, (tuple, list), f"{self.name}: {what}")
            for entry in entries:
                check_instance(entry, kind, f"{self.name}: an entry of {what}")
            object.__setattr__(self, what, tuple(entries))
        check_instance(self.free_start, (tuple, list), f"{self.name}: free_start")
        for name in self.free_start:
            check_instance(name, str, f"{self.name}: an entry of free_start")
        object.__setattr__(self, "free_start", tuple(self.free_start))

    def _check_horizon(self) -> None:
        if not isinstance(self.smoothness, int) or self.smoothness not in (0, 1, 2):
            raise ProblemError(f"{self.name}: smoothness = {self.smoothness!r}, it is 0, 1 or 2")
        if isinstance(self.horizon, FreeTime):
            if self.model.is_discrete:
                raise ProblemError(f"{self.name}: a discrete-time model has no free final time")
            return
        check_positive(self.horizon, f"{self.name}: horizon")
        if self.model.is_discrete and not isinstance(self.horizon, int | np.integer):
            raise ProblemError(
                f"{self.name}: horizon = {self.horizon} of a discrete-time model: it is "
                "a number of steps, a whole one, and no duration"
            )
