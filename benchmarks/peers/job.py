"""What a peer is asked: a problem on its grid, and the situations in which it has to be solved."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, RK4, ProblemError
from ocp.internal import Stage


@dataclass(frozen=True, eq=False)
class Situation:
    """What a controller sees: state (nx,), time [s], and parameters ahead."""

    x0: np.ndarray
    t0: float = 0.0
    parameters: Mapping[str, ArrayLike] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, kw_only=True)
class Job:
    """A problem, a grid, a tolerance, and what is to be solved on them.

    Args:
        name: of the row in the table.
        title: in words.
        ocp: the problem; in continuous time without parameters.
        intervals: N, equal, a held control each, one step of RK4 each.
        situations: the first one is solved cold, the others one after the other, warm.
        tolerance: asked of everybody, each in its own measure of optimality.
        linear: A, B and the weights Q, R, P of a tracking problem, for those who want numbers;
            its reference is then the only parameter.

    Raises:
        ProblemError: for what the exchange cannot say: path constraints, a free final time or
            start, terminal constraints other than prescribed states, parameters in
            continuous time.
    """

    name: str
    title: str
    ocp: OCP
    intervals: int
    situations: tuple[Situation, ...]
    tolerance: float = 1e-8
    linear: Mapping[str, ArrayLike] | None = None

    def __post_init__(self) -> None:
        """Check what can be said."""
        ocp = self.ocp
        if ocp.has_free_time or ocp.has_free_start or ocp.at("path"):
            raise ProblemError(f"job {self.name}: no free time, free start or path constraint")
        if ocp.parameters and not ocp.model.is_discrete:
            raise ProblemError(f"job {self.name}: parameters in continuous time")
        self.end_state  # noqa: B018 - checks

    @property
    def interval(self) -> float:
        """Length of an interval [s]."""
        return self.ocp.duration / self.intervals

    @property
    def end_state(self) -> list[float | None] | None:
        """The prescribed end (nx,), None for a state that is free; None: all are free."""
        terminal = self.ocp.at("terminal")
        if not terminal:
            return None
        end: list[float | None] = [None] * self.ocp.model.nx
        for c in terminal:
            for row, expression in enumerate(ca.vertsplit(c.expression)):
                lower, upper = (np.ravel(b)[row] for b in (c.lower, c.upper))
                found = [i for i in range(len(end)) if ca.is_equal(expression, self.ocp.model.x[i])]
                if lower != upper or not found:
                    raise ProblemError(f"job {self.name}: {c.name} is no prescribed state")
                end[found[0]] = float(lower)
        return end

    @cached_property
    def guess(self) -> dict[str, list]:
        """The same first guess for all: that of the problem, else what happens without control."""
        ocp, fractions = self.ocp, np.linspace(0.0, 1.0, self.intervals + 1)
        if ocp.guess is None:
            return self._idle()
        x = ocp.guess.sample("x", fractions, ocp.model.nx)
        u = ocp.guess.sample("u", fractions[:-1], ocp.model.nu)
        if x is None or u is None:
            raise ProblemError(f"job {self.name}: the guess has no states or no controls")
        return {"x": x.tolist(), "u": u.tolist()}

    def _idle(self) -> dict[str, list]:
        first, h = self.situations[0], self.interval
        step = Stage.of(self.ocp, RK4(), held=True).step
        u, x = np.zeros(self.ocp.model.nu), [self.ocp.start(first.x0)]
        for t, *p in self.along(first)[:-1]:
            x.append(np.array(step(x[-1], u, t, h, p, p)[0]).ravel())
        return {"x": np.array(x).tolist(), "u": np.tile(u, (self.intervals, 1)).tolist()}

    def along(self, situation: Situation) -> list[list[float]]:
        """Return time [s] and parameters at the nodes (N + 1, 1 + np)."""
        fractions = np.linspace(0.0, 1.0, self.intervals + 1)
        t = situation.t0 + self.ocp.duration * fractions
        values = self.ocp.parameter_values(situation.parameters).at(fractions)
        return np.column_stack([t, values]).tolist()
