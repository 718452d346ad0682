"""A problem in normal form, and its solutions in the terms of the user."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid

from ocp.checks.errors import ProblemError
from ocp.method.rewriting import Rewriting, RewrittenGuess
from ocp.normal_form.normal_form import NormalForm
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
        return start

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
        costate = found.costate[:, : m.nx]
        if form.has_jumps:
            at = (found.t, found.fractions, found.data.values)
            costate = form.costate(found.x, found.costate, *at)
        written = found.with_(
            problem=original,
            x=found.x[:, : m.nx],
            x0=found.x0[: m.nx],
            costate=costate,
            u=found.u[:, : m.nu],
            unknowns={name: found.x[0, at] for name, at in self.form.unknowns.items()},
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
        """The unknown constants of which the guess has values."""
        return self.given.unknowns if isinstance(self.given, Guess | Solution) else {}

    def sampled(self, part: str, fractions: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return a part with what is added, (k, n)."""
        match part:
            case "x":
                more = self._states(fractions, values)
            case "u":
                more = self._slacks(fractions, values)
            case _:
                more = np.zeros((len(values), self.form.problem.model.nx - values.shape[1]))
        return np.hstack([values, np.where(np.isfinite(more), more, 0.0)])

    def _states(self, fractions: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the added states: constants, and integrals along the guess."""
        form, nx = self.form, x.shape[1]
        whole = np.tile(form.problem.start(), (len(x), 1))
        whole[:, form.start] = form.copied(x[0])
        for name, at in form.unknowns.items():
            if name in self.known:
                whole[:, at] = self.known[name]
        u = self.given.sample("u", fractions, form.original.model.nu)
        if form.integrals and u is not None:
            along = self._along(form.original.functions.integrands, fractions, x, u)
            rates = np.split(along, np.cumsum([c.size for c in form.original.at("integral")]), 1)
            times = fractions * self._duration
            for at, rate in zip(form.integrals.values(), rates, strict=False):
                whole[:, at] = cumulative_trapezoid(rate, times, axis=0, initial=0.0)
        return whole[:, nx:]

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
