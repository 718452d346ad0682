"""Phases between which nothing happens: time can be shifted from one to the next at no cost."""

import casadi as ca
import numpy as np

from ocp.phases.chain import Chain
from ocp.problem.constraint import Box
from ocp.problem.ocp import OCP

# How deep expressions are compared.
_DEPTH = 100


def undecided_durations(chain: Chain) -> str:
    """Return which neighbours are alike with free durations, as a sentence; empty where none are.

    They have the same model, running cost, path constraints and bounds; states go on from one to
    the next, and the first has no term at its end. Found where both are written in the same
    symbols; what is alike in other symbols is not seen.
    """
    links = chain.links or (None,) * (len(chain.phases) - 1)
    for link, one, other in zip(links, chain.phases, chain.phases[1:], strict=False):
        if (link is None or link.goes_on) and _alike(one, other):
            return (
                f"phases '{one.name}' and '{other.name}' are alike and nothing happens between "
                "them, so their durations are not unique: fix one, or make them one phase"
            )
    return ""


def _alike(one: OCP, other: OCP) -> bool:
    if not (one.has_free_time and other.has_free_time and one.model is other.model):
        return False
    ends = (*one.at("terminal"), *one.at("integral"), *other.at("initial"), *other.at("integral"))
    if ends or not ca.SX(one.terminal_cost).is_zero() or other.unknowns or one.unknowns:
        return False
    same_cost = ca.is_equal(ca.SX(one.running_cost), ca.SX(other.running_cost), _DEPTH)
    same_states = _same(one.state_bounds, other.state_bounds)
    same_boxes = same_states and _same(one.control_bounds, other.control_bounds)
    return same_cost and same_boxes and one.at("path") == other.at("path")


def _same(one: Box, other: Box) -> bool:
    return np.array_equal(one.lower, other.lower) and np.array_equal(one.upper, other.upper)
