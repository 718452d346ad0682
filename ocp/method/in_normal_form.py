"""A problem in normal form, and its solutions in the terms of the user."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.integrate import cumulative_trapezoid

from ocp.checks.errors import ProblemError
from ocp.method.rewriting import Rewriting, RewrittenGuess
from ocp.normal_form.normal_form import NormalForm
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

    def guess(self, given: InitialGuess) -> InitialGuess:
        """Return a guess with what is added; of a solution all that it knows."""
        if isinstance(given, Solution) and given.normal is not None:
            own, normal = self.problem.model, given.normal.problem.model
            if (own.x_names, own.u_names) == (normal.x_names, normal.u_names):
                return given.normal
        m = self.original.model
        widths = {"x": m.nx, "u": m.nu, "costate": m.nx}

        def with_more(part: str, fractions: np.ndarray, values: np.ndarray) -> np.ndarray:
            if part == "x":
                return np.hstack([values, self._states(given, fractions, values)])
            if part == "u":
                return np.hstack([values, self._slacks(given, fractions, values)])
            more = self.problem.model.nx - m.nx
            return np.hstack([values, np.zeros((len(values), more))])

        return RewrittenGuess(given, with_more, widths)

    def answer(self, found: Solution) -> Solution:
        """Return a solution in the terms of the user, which keeps the one in normal form."""
        original, m = self.original, self.original.model
        return found.with_(
            problem=original,
            x=found.x[:, : m.nx],
            x0=found.x0[: m.nx],
            costate=found.costate[:, : m.nx],
            u=found.u[:, : m.nu],
            unknowns={name: found.x[0, at] for name, at in self.form.unknowns.items()},
            normal=found,
        )

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

    def _states(self, given: InitialGuess, fractions: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the added states that go with a guess of the own ones, (k, n)."""
        form, nx = self.form, self.original.model.nx
        whole = np.tile(self.problem.start(), (len(x), 1))
        whole[:, form.start] = form.copied(x[0])
        known = given.unknowns if isinstance(given, Guess | Solution) else {}
        for name, at in form.unknowns.items():
            if name in known:
                whole[:, at] = known[name]
        whole[:, :nx] = x
        u = given.sample("u", fractions, self.original.model.nu)
        if form.integrals and u is not None:
            duration = given.duration or self.original.duration
            rates = self._rates(whole, u, fractions, duration)
            for at in form.integrals.values():
                whole[:, at] = cumulative_trapezoid(
                    rates[:, at], fractions * duration, axis=0, initial=0.0
                )
        return whole[:, nx:]

    def _slacks(self, given: InitialGuess, fractions: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the slacks that go with guessed controls, (k, n)."""
        if not self.form.slacks.numel():
            return np.empty((len(u), 0))
        ocp = self.original
        x = given.sample("x", fractions, ocp.model.nx)
        x = np.tile(ocp.start(), (len(u), 1)) if x is None else x
        p, t = ocp.parameter_values().at(fractions), fractions[None, :] * ocp.duration
        return np.array(self.form.slack.map(len(u))(x.T, u.T, t, p.T)).T

    def _rates(
        self, x: np.ndarray, u: np.ndarray, fractions: np.ndarray, duration: float
    ) -> np.ndarray:
        """Return the rates of all states along a guess, (k, nx)."""
        p = self.problem.parameter_values().at(fractions)
        rate: ca.Function = self.problem.functions.rate.map(len(x))
        return np.array(rate(x.T, u.T, fractions[None, :] * duration, p.T)).T
