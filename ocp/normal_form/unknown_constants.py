r"""Constants that the optimiser chooses, as states that never change and start where it likes.

.. math:: \dot k = 0, \qquad k(t_0) \in [\underline k, \overline k]

Their costate at t0 is the sensitivity dJ*/dk: 0 inside the bounds, on a bound its price. The state
at the start is such a constant too, s with s = x(t0).
"""

from collections.abc import Sequence

import numpy as np

from ocp.normal_form.draft import AddedStates, Draft
from ocp.normal_form.origin import Origin
from ocp.problem.constraint import Constraint
from ocp.problem.scaled import sizes_of


def add_unknowns(draft: Draft) -> dict[str, slice]:
    """Make every unknown constant a state; return where each one stands, by name."""
    ocp = draft.ocp
    return {
        entry.name: draft.add_states(
            AddedStates.constant(ocp, entry.symbol, entry.value, size=entry.size, box=entry.box),
            Origin(entry.name),
        )
        for entry in ocp.unknowns
    }


def add_start(draft: Draft, used: Sequence[int]) -> slice:
    """Make what terms contain of the state at the start states; return where they stand.

    Args:
        draft: the problem so far.
        used: which states these are.
    """
    ocp, m, index = draft.ocp, draft.ocp.model, list(used)
    if not index:
        return slice(m.nx, m.nx)
    symbol, zero = m.start[index], np.zeros(len(index))
    names = [m.x_names[i] for i in index]
    name = draft.unused("start of the states", Origin("start", "definition"))
    draft.constraints.append(Constraint(name, symbol - m.x[index], zero, zero, at="initial"))
    size = sizes_of(ocp).x[index]
    copy = AddedStates.constant(ocp, symbol, ocp.start()[index], size=size)
    return draft.add_states(copy, *[Origin(name) for name in names])
