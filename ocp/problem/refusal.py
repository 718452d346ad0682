"""Refusals that methods share: of free ends, of bounds, of what has no derivatives or no code."""

import numpy as np

from ocp.checks.errors import UnsupportedProblem
from ocp.expressions.foreign_functions import callbacks, external, without_derivatives
from ocp.problem.ocp import OCP


def refuse_free_ends(ocp: OCP, method: str) -> None:
    """Raise ``UnsupportedProblem`` on a free final time or a free start."""
    if ocp.has_free_time:
        raise UnsupportedProblem(f"{ocp.name}: {method} takes no free final time")
    refuse_free_start(ocp, method)


def refuse_free_start(ocp: OCP, method: str) -> None:
    """Raise ``UnsupportedProblem`` on a free start, naming what frees it."""
    if ocp.has_free_start:
        named = (*(c.name for c in ocp.at("initial")), *ocp.free_start)
        raise UnsupportedProblem(
            f"{ocp.name}: {method} takes no free start ('{named[0]}'), it needs one that is given"
        )


def refuse_state_bounds(ocp: OCP, method: str) -> None:
    """Raise ``UnsupportedProblem`` on bounds of states, naming one that is bounded."""
    box, m = ocp.state_bounds, ocp.model
    for i in np.flatnonzero(np.isfinite(box.lower) | np.isfinite(box.upper)):
        name = m.x_names[i]
        is_control = f"rate of {name}" in m.u_names
        why = ", which the bounds of a control with a Rate are" if is_control else ""
        raise UnsupportedProblem(f"{ocp.name}: {method} takes no state bounds ('{name}'){why}")


def refuse_without_derivatives(ocp: OCP, order: int, method: str) -> None:
    """Raise ``UnsupportedProblem`` on a called function with fewer derivatives than these."""
    for function in without_derivatives(ocp.functions.called, order):
        raise UnsupportedProblem(
            f"{ocp.name}: {method} needs {'second' if order > 1 else 'first'} derivatives, which "
            f"the function '{function.name()}' does not bring along: add them to its library "
            "(CodeGenerator.add of its reverse(1), and of that its forward(1)), write it as an "
            "expression or a Table, or construct a Callback with {'enable_fd': True}"
        )


def refuse_compiled(ocp: OCP, *, compiled: bool) -> None:
    """Raise ``UnsupportedProblem`` on a called function whose code is not here to be compiled."""
    found = external(ocp.functions.called) if compiled else []
    for function in found:
        raise UnsupportedProblem(
            f"{ocp.name}: no machine code can be made where '{function.name()}', an external "
            "function or a Python callback, is called: take compiled=False"
        )


def refuse_in_subprocess(ocp: OCP) -> None:
    """Raise ``UnsupportedProblem`` on a Python callback, which no other process has."""
    for function in callbacks(ocp.functions.called):
        raise UnsupportedProblem(
            f"{ocp.name}: fatrop with a time limit runs in a process of its own, which cannot call "
            f"'{function.name()}', a Python callback: take ipopt, or no time limit"
        )
