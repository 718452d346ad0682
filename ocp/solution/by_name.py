"""What a solution says by name: prices of constants and constraints, peaks, what is exceeded."""

from collections.abc import Iterator
from typing import Protocol, Self

import numpy as np

from ocp.normal_form.normal_form import NormalForm, normal_form
from ocp.problem.constraint import Constraint
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData


class _Solved(Protocol):
    """What of a ``Solution`` is asked: its own file is built on this one."""

    @property
    def problem(self) -> OCP: ...

    @property
    def normal(self) -> Self | None: ...

    @property
    def t(self) -> np.ndarray: ...

    @property
    def fractions(self) -> np.ndarray: ...

    @property
    def x(self) -> np.ndarray: ...

    @property
    def costate(self) -> np.ndarray: ...

    @property
    def data(self) -> RunData: ...

    def control(self, t: np.ndarray) -> np.ndarray: ...


def prices_of_constants(solution: _Solved) -> dict[str, np.ndarray]:
    """Return dJ*/dk of every unknown constant, last input and history; see ``sensitivity``."""
    form, normal = _form(solution), solution.normal
    if form is None or normal is None:
        return {}
    sent = {"last_input": form.last_input} if solution.problem.rates else {}
    places = form.unknowns | form.histories | sent
    return {name: normal.costate[0][at] for name, at in places.items()}


def largest_values(solution: _Solved) -> dict[str, float]:
    """Return the largest values along the way, as the solver has them at its nodes."""
    form, normal = _form(solution), solution.normal
    if form is None or normal is None:
        return {}
    return {name: float(normal.x[0, at][0]) for name, at in form.peaks.items()}


def prices_of_constraints(solution: _Solved) -> dict[str, np.ndarray]:
    """Return those of constraints on an integral, (m,), and at instants, (K, m)."""
    form, normal = _form(solution), solution.normal
    if form is None or normal is None:
        return {}
    last = normal.costate[-1]
    found = {name: last[at] for name, at in form.integrals.items()}
    for c in solution.problem.at("instants"):
        found[c.name] = last[form.waypoints.places[c.name]].reshape(-1, c.size)
    return found


def excess_of_soft(solution: _Solved) -> dict[str, np.ndarray]:
    """Return it of soft constraints, (N, m) at all nodes but the last, (m,) at the end."""
    ocp, t, values = solution.problem, solution.t, solution.data.values
    x, u = solution.x[:-1].T, solution.control(t[:-1]).T
    p = values.at(solution.fractions[:-1]).T
    path = ocp.functions.path.map(len(t) - 1)(x, u, t[None, :-1], p)
    end = ocp.functions.terminal(solution.x[-1], t[-1], values.at(1.0)[0])
    return {
        c.name: c.box.excess(rows if c.at == "path" else rows[0])
        for stacked, constraints in ((path, ocp.at("path")), (end, ocp.at("terminal")))
        for c, rows in _split(constraints, np.array(stacked).T)
        if c.soft is not None
    }


def _form(solution: _Solved) -> NormalForm | None:
    """Return the normal form that was solved; None where it is the problem itself."""
    return None if solution.normal is None else normal_form(solution.problem)


def _split(
    constraints: tuple[Constraint, ...], values: np.ndarray
) -> Iterator[tuple[Constraint, np.ndarray]]:
    """Yield constraints with their columns of stacked values (k, m)."""
    ends = np.cumsum([c.size for c in constraints])
    yield from zip(constraints, np.split(values, ends, axis=1), strict=False)
