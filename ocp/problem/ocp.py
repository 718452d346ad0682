"""The optimal control problem in Bolza form, written once for every solver."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_instance, check_numbers, check_positive
from ocp.checks.errors import ProblemError
from ocp.checks.expressions import check_scalar, element_names
from ocp.problem.algebraic import AlgebraicSolution, refuse_unsolvable
from ocp.problem.called_functions import check_kinks
from ocp.problem.constraint import Box, Constraint, Place, check_place
from ocp.problem.constraint_rows import (
    ConstraintRow,
    ConstraintRows,
    ProblemRows,
    depends_on,
)
from ocp.problem.data_checks import check_data, check_instants
from ocp.problem.delay import Delay, check_delays
from ocp.problem.describe import describe
from ocp.problem.first_evaluation import fault_at, inside
from ocp.problem.free_time import FreeTime
from ocp.problem.functions import Functions
from ocp.problem.guess import Guess, check_guess
from ocp.problem.measurement import Measurement
from ocp.problem.model import Model
from ocp.problem.parameters import (
    Entry,
    Parameter,
    ParameterValues,
    PastInput,
    Signal,
    StartValue,
    Steps,
    Unknown,
)
from ocp.problem.peak import Peak
from ocp.problem.portable import Portable
from ocp.problem.problem_checks import (
    check_distinct,
    check_ends,
    check_free_start,
    check_last_input,
    check_peaks,
    check_rates,
    check_start_inside,
    check_symbols,
    check_unknown_names,
    check_used,
)
from ocp.problem.rate import ControlRates, Rate
from ocp.problem.soft import price


@dataclass(frozen=True, eq=False, kw_only=True)
class OCP(Portable):
    r"""An optimal control problem in Bolza form.

    .. math::

        \min \; \varphi(x(t_f), t_f) + \int_{t_0}^{t_f} L(x, u, t)\, dt
        \quad \text{s.t.} \quad \dot x = f(x, u, t), \; x(t_0) = x_0, \; \dots

    With a discrete-time model the integral is the sum of L over the steps (not multiplied
    by dt). Source: thesis (1.5) to (1.9); notation of [Bryson & Ho 1975].

    Args:
        name: what people call it.
        model: the dynamics.
        x0: start (nx,); of what is free of it only a guess.
        horizon: duration [s], ``FreeTime``, or a number of steps for a discrete-time model.
        running_cost: L(x, u, t, parameters).
        terminal_cost: phi(x, t, parameters).
        control_bounds: box around the controls.
        state_bounds: box around the states.
        constraints: path, initial, terminal and integral constraints, and those at instants.
        free_start: names of the states whose start the optimiser chooses, the others start at
            ``x0``; empty: none, or with an ``"initial"`` constraint all.
        start_bounds: box around the free part of the start, at the start alone.
        invariants: what the exact dynamics keep by themselves (the task error of a redundant
            arm, an energy, the norm of a quaternion). No method has to impose them; the
            referee reports how far a solution strays.
        parameters: constants and sampled signals that may change from run to run.
        unknowns: constants that the optimiser chooses.
        peaks: largest values along the way, as terms of the cost.
        rates: how fast controls may change, and what that costs.
        last_input: what the controls that have a ``Rate`` were just before the start, in their
            order in the model (m,): the rate holds from there on. It is a run argument,
            ``run(parameters={"last_input": ...})``; None: the optimiser chooses it.
        data: measurements at instants; the cost gains their least squares.
        delays: controls that act later than they are sent, in discrete time.
        smoothness: 0 the cost has kinks, 1 it is once, 2 twice continuously differentiable.
        guess: where solvers start unless told otherwise.

    Raises:
        ProblemError: naming symbol, shape and place of what is wrong.
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
        """Check every shape, symbol and number, and stack what was given loosely."""
        self._check_kinds()
        model = self.model
        set_ = object.__setattr__
        set_(self, "x0", check_numbers(self.x0, model.nx, f"{self.name}: x0"))
        set_(self, "running_cost", check_scalar(self.running_cost, f"{self.name}: running_cost"))
        set_(self, "terminal_cost", check_scalar(self.terminal_cost, f"{self.name}: terminal_cost"))
        set_(
            self,
            "control_bounds",
            self.control_bounds.sized(model.nu, f"{self.name}: control_bounds"),
        )
        set_(self, "state_bounds", self.state_bounds.sized(model.nx, f"{self.name}: state_bounds"))
        set_(self, "start_bounds", self.start_bounds.sized(model.nx, f"{self.name}: start_bounds"))
        self._check_horizon()
        check_rates(self.name, self.control_rates, model)
        check_delays(self.name, model, self.delays)
        last = check_last_input(
            self.name, self.last_input, self.control_rates, model, self.control_bounds
        )
        set_(self, "last_input", last)
        self._check_terms()
        self._check_start()

    # -- what it is ---------------------------------------------------------------

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

    @property
    def control_rates(self) -> ControlRates:
        """The rates, stacked in the order of the controls."""
        return self._control_rates

    @cached_property
    def _control_rates(self) -> ControlRates:
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

    @property
    def start_is_free(self) -> np.ndarray:
        """Which states start where the optimiser chooses, bool (nx,)."""
        return self._start_is_free

    @cached_property
    def _start_is_free(self) -> np.ndarray:
        if self.free_start:
            return np.array([name in self.free_start for name in self.model.x_names], dtype=bool)
        on_manifold = any(c.at == "initial" for c in self.constraints)
        return np.full(self.model.nx, on_manifold)

    @property
    def has_free_start(self) -> bool:
        """Whether any part of the start is an unknown."""
        return bool(self.start_is_free.any())

    @cached_property
    def decided_by_start(self) -> np.ndarray:
        """Which path rows the given part of the start decides by itself, bool (m,).

        No method imposes them there: nothing could meet them.
        """
        path, free = self.rows.path, np.flatnonzero(self.start_is_free).tolist()
        if len(free) == self.model.nx:
            return np.zeros(len(path), dtype=bool)
        return ~path.on_control & ~depends_on(path.expression, self.model.x[free, :])

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

    @cached_property
    def derived(self) -> dict[Any, Any]:
        """What functions of the problem have made of it, see ``once_per_problem``."""
        return {}

    @cached_property
    def explicit(self) -> "OCP":
        """The problem with its algebraic variables solved for; itself where it has none."""
        if not self.model.nz:
            return self
        solved = self.algebraic_solution
        return replace(self, model=solved.explicit_model, **self.terms(solved))

    @cached_property
    def algebraic_solution(self) -> AlgebraicSolution:
        """The algebraic variables in terms of everything else."""
        return AlgebraicSolution.of(self.model)

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

    @cached_property
    def functions(self) -> Functions:
        """Dynamics, costs with soft prices, and constraints as Functions, built at first use."""
        plain = self.explicit
        return Functions.of(
            plain.model,
            plain.p,
            running_cost=ca.SX(plain.running_cost) + price(plain.at("path")),
            terminal_cost=ca.SX(plain.terminal_cost) + price(plain.at("terminal")),
            constraints=plain.constraints,
            invariants=plain.invariants,
            data=plain.data,
            peaks=plain.peaks,
            algebraic=self.algebraic_solution.values,
        )

    @cached_property
    def rows(self) -> ProblemRows:
        """Bounds and constraints as rows that know where they hold, built at first use."""
        if self.model.nz:
            return self.explicit.rows
        m, box = self.model, self.time_box
        lower, upper = float(np.asarray(box.lower)[0]), float(np.asarray(box.upper)[0])
        return ProblemRows(
            states=ConstraintRows.of_bounds(self.state_bounds, m.x, m.x_names, kind="hard"),
            controls=ConstraintRows.of_bounds(self.control_bounds, m.u, m.u_names, kind="input"),
            path=ConstraintRows.of(self.at("path"), "path", m),
            start=ConstraintRows.of_bounds(
                self.start_box, m.x, m.x_names, kind="hard", place="initial"
            ),
            initial=ConstraintRows.of(self.at("initial"), "initial", m),
            unknowns=self._unknown_rows(),
            terminal=ConstraintRows.of(self.at("terminal"), "terminal", m),
            integral=ConstraintRows.of(self.at("integral"), "integral", m),
            instants=ConstraintRows.of(self.at("instants"), "instants", m),
            invariants=ConstraintRows.of(self.invariants, "path", m),
            rates=self._rate_rows(),
            time=ConstraintRow("final time", "time", 0, lower, upper),
        )

    def _rate_rows(self) -> ConstraintRows:
        rates = self.control_rates
        symbols = ca.vertcat(ca.SX(0, 1), *[ca.SX.sym(name) for name in rates.names])
        return ConstraintRows.of_bounds(rates.box, symbols, rates.names, kind="input")

    def _unknown_rows(self) -> ConstraintRows:
        none = ConstraintRows((), ca.SX(0, 1))
        each = [
            ConstraintRows.of_bounds(
                e.box, e.symbol, element_names(e.symbol), kind="hard", place="initial"
            )
            for e in self.unknowns
        ]
        return sum(each, start=none)

    def parameter_values(self, given: Mapping[str, ArrayLike] | None = None) -> ParameterValues:
        """Return the numbers of a run: the declared ones, replaced by those ``given``."""
        for entry in self.unknowns:
            if given and entry.name in given:
                raise ProblemError(
                    f"{self.name}: '{entry.name}' is an unknown constant, which the optimiser "
                    "chooses; a value to start from is a guess: Guess(unknowns={...})"
                )
        return self._values(given) if given else self._declared

    def values_of(
        self,
        parameters: Mapping[str, ArrayLike],
        unknowns: Mapping[str, ArrayLike],
        start: np.ndarray,
    ) -> ParameterValues:
        """Return the numbers of a solution: also of what the optimiser has chosen.

        Args:
            parameters: values of parameters and samples of signals, by name.
            unknowns: values of unknown constants, by name.
            start: state at the start (nx,).
        """
        begun = {e.name: start for e in self.entries if isinstance(e, StartValue)}
        given = {**parameters, **unknowns, **begun}
        return self._values(given) if given else self._declared

    @cached_property
    def _declared(self) -> ParameterValues:
        return self._values({})

    def _values(self, given: Mapping[str, ArrayLike]) -> ParameterValues:
        values = ParameterValues.of(self.entries, given)
        for entry, value in zip(values.entries, values.values, strict=True):
            if isinstance(entry, Signal) and self.steps and len(value) != self.steps + 1:
                raise ProblemError(
                    f"signal '{entry.name}' has {len(value)} samples; a discrete-time problem of "
                    f"{self.steps} steps needs {self.steps + 1}"
                )
        return values

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

    def describe(self) -> str:
        """Return the problem in mathematics, for a person."""
        return describe(self)

    # -- checks at construction -----------------------------------------------------

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

    def _check_terms(self) -> None:
        name, model = self.name, self.model
        named = (*self.constraints, *self.invariants, *self.peaks)
        check_distinct(name, "constraint", [part.name for part in named])
        check_distinct(name, "parameter", [e.name for e in (*self.given, *self.unknowns)])
        free = self.start_is_free
        check_free_start(name, model.x_names, self.free_start, self.start_bounds, free)
        self.start_box.sized(model.nx, f"{name}: bounds of the start")
        costs = ca.SX(self.running_cost), ca.SX(self.terminal_cost)
        check_symbols(name, model, self.p, costs, self.constraints, self.invariants)
        check_data(self, self.entries)
        check_instants(self, self.at("instants"))
        check_peaks(name, model, self.p, self.peaks)
        terms = [c.expression for c in (*self.constraints, *self.peaks, *self.data)]
        terms += [model.f, model.algebraic, *costs]
        check_used(name, self.unknowns, terms)
        check_unknown_names(name, self.unknowns, model.x_names)
        if model.nz:
            at_ends = [c for c in self.constraints if c.at not in ("path", "integral")]
            named = [(f"{c.at} constraint '{c.name}'", c.expression) for c in at_ends]
            named += [(f"invariant '{c.name}'", c.expression) for c in self.invariants]
            named += [(f"measurement '{c.name}'", c.expression) for c in self.data]
            named.append(("terminal_cost", costs[1]))
            check_ends(name, model, self.algebraic_solution.values, named)

    def _check_start(self) -> None:
        """Evaluate everything once at the start: NaN in data or a singular start shows here."""
        model, x0 = self.model, self.start()
        given = ~self.start_is_free
        check_start_inside(self.name, model.x_names, x0, self.state_bounds, given)
        if self.guess is not None:
            for part, width in (("x", model.nx), ("u", model.nu), ("costate", model.nx)):
                self.guess.sample(part, np.array([0.0]), width)
        p = self.parameter_values().at(0.0)[0]
        controls = self._first_controls()
        if model.nz:
            refuse_unsolvable(self.algebraic_solution, self.p, [(x0, u, 0.0, p) for u in controls])
        check_kinks(self.name, self.functions.called, self.smoothness)
        faults = [fault_at(self.explicit, x0, u, p) for u in controls]
        if all(faults):
            raise ProblemError(f"{self.name}: {faults[0]}; a singular start, or NaN in the data")

    def _first_controls(self) -> list[np.ndarray]:
        """Return the controls with which solvers may start: of the guess or the bounds, and 0."""
        given = self.guess.sample("u", np.array([0.0]), self.model.nu) if self.guess else None
        zero = self.control_bounds.clip(np.zeros(self.model.nu))
        return [inside(self.control_bounds) if given is None else given[0], zero]
