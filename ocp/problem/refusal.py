"""Refusal of free starts and durations by methods that go step by step from a given start."""

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
