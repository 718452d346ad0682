"""A problem in normal form, and its solutions in the terms of the user."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid

from ocp.checks.errors import ProblemError
from ocp.method.own_controls import own_controls
from ocp.method.rewriting import Rewriting, RewrittenGuess
from ocp.normal_form.normal_form import NormalForm
from ocp.normal_form.peaks import largest
from ocp.problem.data_residuals import data_cost
from ocp.problem.guess import Guess
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess


@dataclass(frozen=True, eq=False)
class InNormalForm(Rewriting):
    """The normal form.

    Attributes:
        form: of the problem.
    """

    form: NormalForm

    @property
    def original(self) -> OCP:
        """The problem in the terms of the user."""
        return self.form.original

    @property
    def problem(self) -> OCP:
        """The problem in normal form."""
        return self.form.problem

    def start(self, data: RunData) -> np.ndarray:
        """Return the start with the guesses of what is added."""
        start = self.problem.start().copy()
        start[: len(data.x0)] = data.x0
        start[self.form.start] = self.form.copied(data.x0)
        for name, at in self.form.given.items():
            start[at] = data.values.named(name)
        return start

    def parameters(self, given: Mapping[str, ArrayLike] | None) -> Mapping[str, ArrayLike] | None:
        """Return what is a parameter of the normal form too: what was sent is a start there."""
        starts = self.form.given
        return given and {name: value for name, value in given.items() if name not in starts}

    def guess(self, given: InitialGuess, data: RunData) -> InitialGuess:
        """Return a guess with what is added; of a solution all that it knows."""
        if isinstance(given, Solution) and given.normal is not None:
            own, normal = self.problem.model, given.normal.problem.model
            if (own.x_names, own.u_names) == (normal.x_names, normal.u_names):
                return given.normal
        added = _Added(self.form, given, data)
        # Without states in it, a guess may know constants.
        instead = {"x": data.x0} if added.known else {}
        return RewrittenGuess(given, added.sampled, self.original.model, instead)

    def answer(self, found: Solution) -> Solution:
        """Return a solution in the terms of the user, which keeps the one in normal form."""
        original, m, form = self.original, self.original.model, self.form
        sent = {name: found.x0[at] for name, at in form.given.items()}
        costate = found.costate[:, : m.nx]
        if form.has_jumps:
            at = (found.t, found.fractions, found.data.values)
            costate = form.costate(found.x, found.costate, *at)
        written = found.with_(
            problem=original,
            x=found.x[:, : m.nx],
            x0=found.x0[: m.nx],
            costate=costate,
            **own_controls(form, found),
            parameters={**found.parameters, **sent},
            unknowns={name: found.x[0, at] for name, at in form.unknowns.items()},
            normal=found,
        )
        if form.data is None:
            return written
        # Of a sum of squares that is small, two integrals that nearly cancel have few digits.
        once = form.integrated_data(found.x[-1], found.t[-1], found.data.values)
        return written.with_(cost=found.cost - once + data_cost(written.residuals))

    def written(self, solution: Solution) -> Solution:
        """Return the solution in normal form, which a solver's answer keeps.

        Raises:
            ProblemError: where it keeps none.
        """
        if solution.normal is None:
            raise ProblemError(
                f"{self.original.name}: the solution lacks what its normal form adds; take one "
                "that a solver has returned"
            )
        return solution.normal


@dataclass(frozen=True, eq=False)
class _Added:
    """What a normal form adds to a guess of a run."""

    form: NormalForm
    given: InitialGuess
    data: RunData

    @property
    def known(self) -> Mapping[str, ArrayLike]:
        """The unknown constants of the problem of which the guess has values."""
        if not isinstance(self.given, Guess | Solution):
            return {}
        own = {entry.name for entry in self.form.original.unknowns}
        return {name: value for name, value in self.given.unknowns.items() if name in own}

    def sampled(self, part: str, fractions: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return a part with what is added, (k, n)."""
        match part:
            case "x":
                more = self._states(fractions, values)
            case "u":
                return self._controls(fractions, values)
            case _:
                more = np.zeros((len(values), self.form.problem.model.nx - values.shape[1]))
        return np.hstack([values, _finite(more)])

    def _controls(self, fractions: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the controls that are left, rates of the others, and slacks."""
        form, times = self.form, fractions * self._duration
        is_state = form.controls < form.problem.model.nx
        moved = u[:, is_state]
        rates = np.zeros_like(moved)
        if moved.size and len(u) > 1:
            with np.errstate(all="ignore"):  # instants may coincide
                rates = np.gradient(moved, times, axis=0)
        return np.hstack([u[:, ~is_state], _finite(rates), _finite(self._slacks(fractions, u))])

    def _states(self, fractions: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the added states: constants, and integrals along the guess."""
        form, nx = self.form, x.shape[1]
        whole = np.tile(form.problem.start(), (len(x), 1))
        whole[:, form.start] = form.copied(x[0])
        for name, at in form.unknowns.items():
            if name in self.known:
                whole[:, at] = self.known[name]
        u = self.given.sample("u", fractions, form.original.model.nu)
        if u is not None:
            self._fill_sent(whole, u)
            self._fill_values(whole, fractions, x, u)
        return whole[:, nx:]

    def _fill_sent(self, whole: np.ndarray, u: np.ndarray) -> None:
        """Write what was sent (k, nu) into the states (k, n) that keep it."""
        form, original = self.form, self.form.original
        if len(rates := original.control_rates):
            # Of a control that is a state itself; in discrete time of the one before.
            before = u if len(form.rates) else np.vstack([u[:1], u[:-1]])
            whole[:, form.last_input] = before[:, rates.index]
        for delay in original.delays:
            at = form.histories[delay.name]
            sent = np.append(whole[0, at], u[:, delay.index(original.model)])
            rows = np.lib.stride_tricks.sliding_window_view(sent, delay.steps)
            whole[:, at] = rows[: len(whole)]

    def _fill_values(
        self, whole: np.ndarray, fractions: np.ndarray, x: np.ndarray, u: np.ndarray
    ) -> None:
        """Write peaks and integrals along the guess into their states (k, n)."""
        form, original = self.form, self.form.original
        if form.peaks:
            along = self._along(original.functions.peaks, fractions, x, u)
            for at, top in zip(form.peaks.values(), largest(original.peaks, along), strict=True):
                whole[:, at] = top
        if form.integrals:
            along = self._along(original.functions.integrands, fractions, x, u)
            rates = np.split(along, np.cumsum([c.size for c in original.at("integral")]), 1)
            times = fractions * self._duration
            for at, rate in zip(form.integrals.values(), rates, strict=False):
                whole[:, at] = cumulative_trapezoid(rate, times, axis=0, initial=0.0)

    def _slacks(self, fractions: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the slacks that go with guessed controls."""
        if not self.form.slacks.numel():
            return np.empty((len(u), 0))
        x = self.given.sample("x", fractions, self.form.original.model.nx)
        x = np.tile(self.data.x0, (len(u), 1)) if x is None else x
        return self._along(self.form.slack, fractions, x, u)

    def _along(
        self, function: ca.Function, fractions: np.ndarray, x: np.ndarray, u: np.ndarray
    ) -> np.ndarray:
        """Return a function of (x, u, t, p) of the original along the guess, (k, m)."""
        t, values = self.data.t0 + fractions * self._duration, self.data.values
        p = self.form.original.values_of(values.as_dict(), self.known, x[0]).at(fractions)
        return np.array(function.map(len(x))(x.T, u.T, t[None, :], p.T)).T

    @property
    def _duration(self) -> float:
        return self.given.duration or self.form.original.duration


def _finite(values: np.ndarray) -> np.ndarray:
    """Return values with 0 for what is no number."""
    return np.where(np.isfinite(values), values, 0.0)
