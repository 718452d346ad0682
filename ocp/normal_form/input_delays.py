r"""Controls that act later: states that pass them on.

.. math:: v^1_{k+1} = v^2_k, \quad \dots, \quad v^d_{k+1} = u_k, \qquad
          x_{k+1} = f(x_k, v^1_k, t_k), \qquad v_0 = (u_{-d}, \dots, u_{-1})
"""

import casadi as ca
import numpy as np

from ocp.normal_form.draft import AddedStates, Draft
from ocp.normal_form.origin import Origin
from ocp.problem.constraint import Box
from ocp.problem.scaled import sizes_of


def add_delays(draft: Draft) -> dict[str, slice]:
    """Add the states; return where they stand, by the name of the run argument they start at."""
    ocp, found = draft.ocp, {}
    for delay in ocp.delays:
        entry, u = delay.entry(), delay.control
        sent, size = entry.symbol, sizes_of(ocp).u[delay.index(ocp.model)]
        draft.f = ca.substitute(draft.f, u, sent[0])
        found[delay.name] = draft.add_states(
            AddedStates(
                symbol=sent,
                rate=ca.vertcat(*ca.vertsplit(sent)[1:], u),
                start=entry.value,
                is_free=False,
                box=Box.unbounded(delay.steps),
                size=np.full(delay.steps, size),
            ),
            Origin(str(u)),
        )
    return found
