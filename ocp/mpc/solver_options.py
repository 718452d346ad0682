"""A solver as a loop needs it."""

from dataclasses import fields, is_dataclass, replace
from typing import Any

from ocp.solution.solver import Solver

# What a run may take where a solver sets no limit [s]: far more than a control loop has.
_PATIENCE = 10.0


def with_mpc_defaults(solver: Solver, *, compiled: bool) -> Solver:
    """Return the solver, and those inside it, compiled where that is wanted and sure to return.

    Only options that a solver has are set, ``time_limit`` only where it is left open.
    """
    if not is_dataclass(solver):
        return solver
    wanted: dict[str, Any] = {}
    for option in fields(solver):
        value = getattr(solver, option.name)
        if option.name == "compiled" and compiled:
            wanted[option.name] = True
        elif option.name == "time_limit" and value is None:
            wanted[option.name] = _PATIENCE
        elif (
            isinstance(value, Solver)
            and (inner := with_mpc_defaults(value, compiled=compiled)) is not value
        ):
            wanted[option.name] = inner
    return replace(solver, **wanted) if wanted else solver
