"""Checks of what holds at instants, measurements and constraints, against states and horizon."""

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from ocp.checks.errors import ProblemError
from ocp.checks.expressions import refuse_foreign_symbols
from ocp.problem.parameters import Parameter, Unknown
from ocp.problem.statement import Statement

# An instant is the end of the horizon, or a step, if it is nearer than this, relative to either.
_ROUNDING = 1e-9


def check_data(ocp: Statement) -> None:
    """Refuse measurements of what has no value at an instant, or outside the horizon."""
    if not ocp.data:
        return
    _check_names(ocp.name, [m.name for m in ocp.data])
    constants = [e.symbol for e in ocp.entries if isinstance(e, Parameter | Unknown)]
    for m in ocp.data:
        what = f"{ocp.name}: measurement '{m.name}'"
        refuse_foreign_symbols(
            m.expression, [ocp.model.x, ocp.model.z, ocp.model.t, *constants], what
        )
        if not ca.depends_on(m.expression, ca.vertcat(ocp.model.x, ocp.model.z)):
            raise ProblemError(f"{what}: it contains no state")
        _check_times(ocp, np.asarray(m.times), what)


def check_instants(ocp: Statement, solved: Callable[[ca.SX], ca.SX]) -> None:
    """Refuse constraints at instants outside the horizon, at its start, or of what is sampled.

    Args:
        ocp: the problem.
        solved: puts what algebraic variables are in their place.
    """
    for c in ocp.at("instants"):
        what = f"{ocp.name}: constraint '{c.name}'"
        _check_times(ocp, c.instants, what)
        for entry in ocp.moving:
            if ca.depends_on(solved(c.expression), entry.symbol):
                raise ProblemError(
                    f"{what}: it holds at instants and contains the signal '{entry.name}', whose "
                    "slope nothing knows: write its value there as a Parameter"
                )
        if c.instants[0] <= _ROUNDING * ocp.duration:
            raise ProblemError(f"{what}: t = 0 s is the start: write at='initial'")


def _check_times(ocp: Statement, times: np.ndarray, what: str) -> None:
    """Refuse instants (K,) outside the horizon, or between the steps of discrete time."""
    if ocp.has_free_time:
        raise ProblemError(
            f"{what}: its instants are seconds, and the final time is free: give a horizon, or "
            "scale time by an unknown constant"
        )
    outside = (times < 0.0) | (times > ocp.duration * (1.0 + _ROUNDING))
    if outside.any():
        raise ProblemError(
            f"{what}: t = {times[outside.argmax()]:g} s is not within the horizon of "
            f"{ocp.duration:g} s"
        )
    step = ocp.model.dt
    if step is not None and (np.abs(times / step - np.round(times / step)) > 1e-6).any():
        raise ProblemError(f"{what}: its instants are no multiples of the step of {step:g} s")


def _check_names(owner: str, names: Sequence[str]) -> None:
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise ProblemError(f"{owner}: two measurements are called '{twice[0]}'")
