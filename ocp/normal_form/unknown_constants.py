r"""Constants that the optimiser chooses, as states that never change and start where it likes.

.. math:: \dot k = 0, \qquad k(t_0) \in [\underline k, \overline k]

Their costate at t0 is the sensitivity dJ*/dk: 0 inside the bounds, on a bound its price. The state
at the start is such a constant too, s with s = x(t0).
"""

import numpy as np

from ocp.normal_form.draft import AddedStates, Draft
from ocp.problem.constraint import Constraint
from ocp.problem.parameters import Unknown
from ocp.problem.scaled import sizes_of


def add_unknowns(draft: Draft) -> dict[str, slice]:
    """Make every unknown constant a state; return where each one stands, by name."""
    ocp = draft.ocp
    return {
        entry.name: draft.add_states(
            AddedStates.constant(ocp, entry.symbol, entry.value, size=_size(entry), box=entry.box)
        )
        for entry in ocp.unknowns
    }


def add_start(draft: Draft) -> slice:
    """Make the state at the start, where terms contain it, a state; return where it stands."""
    ocp, m = draft.ocp, draft.ocp.model
    if not ocp.refers_to_start:
        return slice(m.nx, m.nx)
    same = Constraint(
        draft.unused("start of the states"),
        m.start - m.x,
        np.zeros(m.nx),
        np.zeros(m.nx),
        at="initial",
    )
    draft.constraints.append(same)
    return draft.add_states(AddedStates.constant(ocp, m.start, ocp.start(), size=sizes_of(ocp).x))


def _size(entry: Unknown) -> np.ndarray:
    """Return typical sizes of an unknown constant: of its guess, or of its bounds."""
    known = np.abs([entry.value, np.asarray(entry.lower), np.asarray(entry.upper)])
    guess, bounds = known[0], np.where(np.isfinite(known[1:]), known[1:], 0.0).max(axis=0)
    size = np.where(guess > 0.0, guess, bounds)
    return np.where(size > 0.0, size, 1.0)
