"""The optimal control problem in Bolza form, written once for every solver."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.errors import ProblemError
from ocp.checks.rich_text import counted, html_of
from ocp.problem.algebraic import AlgebraicSolution, refuse_unsolvable
from ocp.problem.called_functions import check_kinks
from ocp.problem.constraint_rows import (
    ProblemRows,
    depends_on,
)
from ocp.problem.data_checks import check_data, check_instants
from ocp.problem.delay import check_delays
from ocp.problem.describe import describe
from ocp.problem.first_evaluation import fault_at
from ocp.problem.functions import Functions
from ocp.problem.parameters import (
    ParameterValues,
    Signal,
    StartValue,
)
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
from ocp.problem.problem_rows import problem_rows
from ocp.problem.soft import price
from ocp.problem.statement import Statement


@dataclass(frozen=True, eq=False, kw_only=True)
class OCP(Statement):
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

    def __post_init__(self) -> None:
        """Check every symbol and number."""
        super().__post_init__()
        model = self.model
        check_rates(self.name, self.control_rates, model)
        check_delays(self.name, model, self.delays)
        self._check_delayed()
        last = check_last_input(
            self.name, self.last_input, self.control_rates, model, self.control_bounds
        )
        object.__setattr__(self, "last_input", last)
        self._check_terms()
        self._check_start()

    # -- what it is ---------------------------------------------------------------

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
        return problem_rows(self)

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

    def describe(self) -> str:
        """Return the problem in mathematics, for a person."""
        return describe(self)

    def __repr__(self) -> str:
        """Return one line; ``describe`` says the whole problem."""
        parts = [
            (len(self.constraints), "constraint"),
            (len(self.unknowns), "unknown constant"),
            (len(self.data), "measurement"),
        ]
        said = [counted(self.model.nx, "state"), counted(self.model.nu, "control")]
        said += [counted(number, what) for number, what in parts if number]
        time = f"{self.duration:g} s"
        if self.has_free_time:
            time = "free final time"
        elif self.steps is not None:
            time = counted(self.steps, "step")
        return f"<OCP '{self.name}': {', '.join(said)}, {time}; describe() says it all>"

    def _repr_html_(self) -> str:
        """Return the problem in mathematics, for a notebook."""
        return html_of(self.name, self.describe())

    # -- checks at construction -----------------------------------------------------

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
        check_data(self)
        check_instants(self, self.algebraic_solution)
        check_peaks(name, model, self.p, self.peaks)
        terms = [c.expression for c in (*self.constraints, *self.peaks, *self.data)]
        terms += [model.f, model.algebraic, *costs]
        check_used(name, self.unknowns, terms)
        rated = [model.u_names[i] for i in self.control_rates.index]
        check_unknown_names(name, self.unknowns, (*model.x_names, *rated))
        if model.nz:
            at_ends = [c for c in self.constraints if c.at not in ("path", "integral")]
            named = [(f"{c.at} constraint '{c.name}'", c.expression) for c in at_ends]
            named += [(f"invariant '{c.name}'", c.expression) for c in self.invariants]
            named += [(f"measurement '{c.name}'", c.expression) for c in self.data]
            named.append(("terminal_cost", costs[1]))
            check_ends(name, model, self.algebraic_solution.values, named)

    def _check_delayed(self) -> None:
        """Refuse a delayed control in algebraic equations, and one with a rate that begins anew."""
        for delay in self.delays:
            name = str(delay.control)
            if ca.depends_on(self.algebraic_solution.values, delay.control):
                raise ProblemError(
                    f"{self.name}: the Delay of '{name}': an algebraic variable depends on it and "
                    "would know it at once; write the control that acts as a state of the model"
                )
            i = delay.index(self.model)
            if i not in self.control_rates.index:
                continue
            newest, last = np.asarray(delay.history).ravel()[-1], self.last_input
            at = int(np.flatnonzero(self.control_rates.index == i)[0])
            if last is None or np.asarray(last)[at] != newest:
                raise ProblemError(
                    f"{self.name}: control '{name}' has a Rate and a Delay: its last_input is the "
                    f"newest of its history, {newest:g}; give it so"
                )

    def _check_start(self) -> None:
        """Evaluate everything once at the start: NaN in data or a singular start shows here."""
        model, x0 = self.model, self.start()
        given = ~self.start_is_free
        check_start_inside(self.name, model.x_names, x0, self.state_bounds, given)
        if self.guess is not None:
            for part, width in (("x", model.nx), ("u", model.nu), ("costate", model.nx)):
                self.guess.sample(part, np.array([0.0]), width)
        p = self.parameter_values().at(0.0)[0]
        controls = self.first_controls()
        if model.nz:
            refuse_unsolvable(self.algebraic_solution, self.p, [(x0, u, 0.0, p) for u in controls])
        check_kinks(self.name, self.functions.called, self.smoothness)
        faults = [fault_at(self.explicit, self.functions, x0, u, p) for u in controls]
        if all(faults):
            raise ProblemError(f"{self.name}: {faults[0]}; a singular start, or NaN in the data")
