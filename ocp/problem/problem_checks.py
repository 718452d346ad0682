"""Checks of a problem's parts against each other, in words that name what is wrong."""

from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_numbers
from ocp.checks.errors import ProblemError
from ocp.checks.expressions import element_names, refuse_foreign_symbols
from ocp.problem.constraint import Box, Constraint
from ocp.problem.model import Model
from ocp.problem.parameters import Unknown
from ocp.problem.peak import Peak
from ocp.problem.rate import ControlRates

# A measured state on its bound may lie beyond it by this, relative to 1 + abs(x).
_ROUNDING = 1e-9


def check_distinct(owner: str, kind: str, names: Sequence[str]) -> None:
    """Refuse two entries of one name."""
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise ProblemError(f"{owner}: two {kind}s are called '{twice[0]}'")


def check_symbols(
    owner: str,
    model: Model,
    p: ca.SX,
    costs: tuple[ca.SX, ca.SX],
    constraints: Iterable[Constraint],
    invariants: Iterable[Constraint],
) -> None:
    """Refuse a symbol that is declared twice, or is unknown where it stands.

    Args:
        owner: name of the problem.
        model: its dynamics.
        p: symbols of parameters and other constants (n_p,).
        costs: running and terminal.
        constraints: of any place.
        invariants: they hold along the way.
    """
    everywhere, at_ends = [model.x, model.u, model.t, p, model.z], [model.x, model.t, p, model.z]
    symbols = ca.vertcat(*everywhere)
    if len({e.element_hash() for e in ca.vertsplit(symbols)}) < len(element_names(symbols)):
        raise ProblemError(f"{owner}: a symbol is declared twice among x, u, t, z and parameters")
    model.refuse_foreign_symbols(p)
    refuse_foreign_symbols(costs[0], everywhere, f"{owner}: running_cost")
    refuse_foreign_symbols(costs[1], at_ends, f"{owner}: terminal_cost")
    for c in constraints:
        allowed = everywhere if c.at in ("path", "integral") else at_ends
        refuse_foreign_symbols(c.expression, allowed, f"{owner}: {c.at} constraint '{c.name}'")
        if c.at == "integral" and model.is_discrete:
            raise ProblemError(
                f"{owner}: integral constraint '{c.name}': the model is discrete in time; "
                "carry the sum as a state s[k+1] = s[k] + ... with a bound at the end"
            )
    for c in invariants:
        refuse_foreign_symbols(c.expression, at_ends, f"{owner}: invariant '{c.name}'")
        if c.at != "path":
            raise ProblemError(f"{owner}: invariant '{c.name}' must hold at='path'")


def check_ends(owner: str, model: Model, values: ca.SX, terms: Iterable[tuple[str, ca.SX]]) -> None:
    """Refuse an algebraic variable that depends on a control where there is none.

    Args:
        owner: name of the problem.
        model: its dynamics.
        values: the algebraic variables in terms of everything else (nz,).
        terms: what contains no control: what a message calls it, and its expression.
    """
    each = zip(ca.vertsplit(model.z), ca.vertsplit(values), strict=True)
    moved = [z for z, value in each if ca.depends_on(value, model.u)]
    for what, expression in terms:
        for z in moved:
            if ca.depends_on(expression, z):
                raise ProblemError(
                    f"{owner}: {what} contains the algebraic variable {z}, which depends on a "
                    "control; there is none at this place"
                )


def check_unknown_names(owner: str, unknowns: Iterable[Unknown], others: Sequence[str]) -> None:
    """Refuse an unknown constant whose symbol has the name of a state, or of another one."""
    taken = list(others)
    for entry in unknowns:
        for name in element_names(entry.symbol):
            if name in taken:
                raise ProblemError(
                    f"{owner}: unknown constant '{entry.name}': its symbol is called '{name}' as "
                    "another symbol is; give it a name of its own"
                )
            taken.append(name)


def check_used(owner: str, unknowns: Sequence[Unknown], terms: Sequence[ca.SX]) -> None:
    """Refuse an unknown constant on which none of some terms depends."""
    if not unknowns:  # a long expression is not searched for nothing
        return
    hashes = {symbol.element_hash() for symbol in ca.symvar(ca.veccat(*terms))}
    for entry in unknowns:
        for symbol in ca.vertsplit(entry.symbol):
            if symbol.element_hash() not in hashes:
                raise ProblemError(
                    f"{owner}: unknown constant '{entry.name}' ({symbol}) appears in no "
                    "dynamics, cost or constraint: nothing decides its value"
                )


def check_rates(owner: str, rates: ControlRates, model: Model) -> None:
    """Refuse a rate of a control that has the name of a state, or of another control."""
    for i in rates.index:
        name = model.u_names[i]
        if (*model.x_names, *model.u_names).count(name) > 1:
            raise ProblemError(
                f"{owner}: a Rate of control '{name}': another symbol is called so as well; give "
                "it a name of its own"
            )


def check_last_input(
    owner: str, given: ArrayLike | None, rates: ControlRates, model: Model, bounds: Box
) -> np.ndarray | None:
    """Return the last input of the controls that have a rate (m,), checked; None: it is free.

    Args:
        owner: name of the problem.
        given: by the user.
        rates: of the problem.
        model: its dynamics.
        bounds: of the controls, each (nu,).
    """
    if given is None:
        return None
    what = f"{owner}: last_input"
    if not len(rates):
        raise ProblemError(f"{what} is given, but no control has a Rate")
    last = check_numbers(given, len(rates), what)
    outside = bounds[rates.index.tolist()].excess(last)
    for i in np.flatnonzero(outside > 0.0):
        name = model.u_names[rates.index[i]]
        raise ProblemError(f"{what}[{i}] = {last[i]} is outside the bounds of {name}")
    return last


def check_peaks(owner: str, model: Model, p: ca.SX, peaks: Iterable[Peak]) -> None:
    """Refuse a symbol that is unknown; p are parameters and other constants (n_p,)."""
    for peak in peaks:
        what = f"{owner}: peak '{peak.name}'"
        allowed = [model.x, model.u, model.z, model.t, p]
        refuse_foreign_symbols(peak.expression, allowed, what)


def check_free_start(
    owner: str, names: tuple[str, ...], chosen: Iterable[str], bounds: Box, free: np.ndarray
) -> None:
    """Check which states start where the optimiser chooses, and their bounds there.

    Args:
        owner: name of the problem.
        names: of the states.
        chosen: those that are to start anywhere.
        bounds: of the start, each (nx,).
        free: whether a state's start is free, bool (nx,).
    """
    for name in chosen:
        if name not in names:
            raise ProblemError(
                f"{owner}: free_start: '{name}' is no state; they are {', '.join(names)}"
            )
        if names.count(name) > 1:
            raise ProblemError(f"{owner}: free_start: two states are called '{name}'")
    bounded = np.isfinite(bounds.lower) | np.isfinite(bounds.upper)
    for i in np.flatnonzero(bounded & ~free):
        raise ProblemError(
            f"{owner}: start_bounds[{i}]: the start of {names[i]} is given; name it in free_start"
        )


def check_start_inside(
    owner: str, names: tuple[str, ...], x0: np.ndarray, box: Box, given: np.ndarray
) -> None:
    """Refuse a start (nx,) outside the bounds of the states, where it is given, bool (nx,)."""
    excess = box.excess(x0)
    outside = np.flatnonzero(given & (excess > _ROUNDING * (1.0 + np.abs(x0))))
    if outside.size:
        i = int(outside[0])
        low, high = (np.asarray(b)[i] for b in (box.lower, box.upper))
        raise ProblemError(
            f"{owner}: x0[{i}] ({names[i]}) = {x0[i]} is outside its bounds [{low}, {high}]"
        )
