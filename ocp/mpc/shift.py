"""An earlier plan, seen from a later instant: what is left of it, and as a first guess."""

import numpy as np

from ocp.guess import Guess
from ocp.solution import Solution


def shifted(plan: Solution, t0: float) -> Guess:
    """Return a plan moved to start at t0 [s], as a first guess for the same horizon.

    States, controls and costates are read off at the later instants. Beyond its end the plan
    goes on as it ended: states along their last slope, controls held, costates at their final
    value (what the transversality condition makes them anyway).
    """
    # Equally spaced, as the rows of a guess are; the nodes of a plan need not be.
    times = t0 + np.linspace(0.0, plan.duration, len(plan.t))
    nx = plan.x.shape[1]
    both = _along(times, plan.t, np.hstack([plan.x, plan.costate]))
    x, costate = both[:, :nx], both[:, nx:]
    beyond = np.maximum(times - plan.t[-1], 0.0)[:, None]
    x += beyond * ((plan.x[-1] - plan.x[-2]) / (plan.t[-1] - plan.t[-2]))
    return Guess(x=x, u=controls(plan, times), costate=costate)


def controls(plan: Solution, times: np.ndarray) -> np.ndarray:
    """Return the controls of a plan at some instants (K,) -> (K, nu), the last one held.

    An extremal's are interpolated from its nodes: a guess needs no more, and the minimising
    control would have to be solved for.
    """
    if plan.control_kind == "held":
        index = np.searchsorted(plan.t, times + 1e-9 * plan.duration, side="right") - 1
        return plan.u[np.minimum(np.maximum(index, 0), len(plan.u) - 1)]
    if plan.control_kind == "polynomial":
        return plan.pieces.at(times)
    return _along(times, plan.t, plan.u)


def _along(times: np.ndarray, nodes: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """``np.interp`` of all columns at once."""
    left = np.searchsorted(nodes, times, side="right") - 1
    left = np.minimum(np.maximum(left, 0), len(nodes) - 2)
    share = (times - nodes[left]) / (nodes[left + 1] - nodes[left])
    share = np.minimum(np.maximum(share, 0.0), 1.0)[:, None]
    below = rows[left]
    return below + share * (rows[left + 1] - below)
