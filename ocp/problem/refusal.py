"""Refusal of what some methods do not take: free starts and durations, bounds of states."""

import numpy as np

from ocp.checks.errors import UnsupportedProblem
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
