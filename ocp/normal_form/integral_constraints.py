r"""Bounds of integrals over the horizon, as bounds of states at the end.

.. math:: \dot q = g(x, u, t), \quad q(t_0) = 0, \quad \underline q \le q(t_f) \le \overline q

The costate of q never changes. It is the multiplier of the bounds: the price of the integral.
"""

import casadi as ca
import numpy as np

from ocp.normal_form.draft import AddedStates, Draft
from ocp.normal_form.origin import Origin
from ocp.problem.constraint import Box, Constraint
from ocp.problem.scaled import sizes_of


def add_integrals(draft: Draft) -> dict[str, slice]:
    """Replace every integral constraint; return where its state stands, by name."""
    found: dict[str, slice] = {}
    for i, c in enumerate(draft.constraints):
        if c.at != "integral":
            continue
        each = [c.name] if c.size == 1 else [f"{c.name}_{k}" for k in range(c.size)]
        total = ca.vertcat(*[ca.SX.sym(f"integral of {name}") for name in each])
        found[c.name] = draft.add_states(
            AddedStates(
                symbol=total,
                rate=c.expression,
                start=np.zeros(c.size),
                is_free=False,
                box=Box.unbounded(c.size),
                size=sizes_of(draft.ocp).rows[c.name],
            ),
            Origin(c.name, "integral"),
        )
        draft.origins[c.name] = Origin(c.name, "integral")
        draft.constraints[i] = Constraint(
            c.name, total, c.lower, c.upper, at="terminal", nominal=c.nominal
        )
    return found
