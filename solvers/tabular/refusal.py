"""Refusal of free starts and durations by methods that go step by step from a given start."""

from ocp import OCP, UnsupportedProblem


def refuse_free_ends(ocp: OCP, method: str) -> None:
    """Raise ``UnsupportedProblem`` on a free final time or a free start."""
    if ocp.has_free_time:
        raise UnsupportedProblem(f"{ocp.name}: {method} takes no free final time")
    for c in ocp.at("initial"):
        raise UnsupportedProblem(f"{ocp.name}: {method} takes no free start ('{c.name}')")
