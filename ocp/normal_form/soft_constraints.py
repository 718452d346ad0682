r"""Constraints that may be exceeded at a price, with slacks.

.. math::

    \min J + \int w s + q s^2 \, dt \quad \text{s.t.} \quad
    \underline c - s \le c(x, u, t) \le \overline c + s, \quad s \ge 0

Along the way the slack is a control, at the end a constant. A price w above the multiplier of the
hard constraint is exact: the constraint is met wherever it can be. A price that is only quadratic
needs no slack: q max(0, c - upper)^2 is smooth once.
"""

import casadi as ca
import numpy as np

from ocp.normal_form.draft import AddedControls, AddedStates, Draft
from ocp.normal_form.origin import Origin
from ocp.problem.constraint import Box, Constraint
from ocp.problem.scaled import sizes_of
from ocp.problem.soft import excess, slackened


def soften(draft: Draft) -> ca.SX:
    """Replace every soft constraint; return what the slacks among the controls stand for."""
    slacks = [ca.SX(0, 1)]
    for c in [c for c in draft.constraints if c.soft is not None]:
        sizes = sizes_of(draft.ocp).rows
        draft.constraints.remove(c)
        priced = np.asarray(c.soft.linear) > 0.0 if c.soft else np.zeros(c.size, dtype=bool)
        for with_slack in (True, False):
            index = np.flatnonzero(priced == with_slack).tolist()
            if not index:
                continue
            part = _rows(c, index)
            if not with_slack:
                _add_square(draft, part)
                continue
            _add_slack(draft, part, sizes[c.name][index])
            if c.at == "path":
                slacks.append(ca.fabs(excess(part)))
    return ca.vertcat(*slacks)


def _rows(c: Constraint, index: list[int]) -> Constraint:
    """Return some rows of a soft constraint."""
    assert c.soft is not None
    return Constraint(
        c.name,
        c.expression[index],
        np.asarray(c.lower)[index],
        np.asarray(c.upper)[index],
        at=c.at,
        nominal=None if c.nominal is None else np.broadcast_to(c.nominal, c.size)[index],
        soft=c.soft.rows(index),
    )


def _add_slack(draft: Draft, c: Constraint, sizes: np.ndarray) -> None:
    assert c.soft is not None
    names = [f"excess of {c.name}" + (f"_{i}" if c.size > 1 else "") for i in range(c.size)]
    s = ca.vertcat(*[ca.SX.sym(name) for name in names])
    box = Box(np.zeros(c.size), np.full(c.size, np.inf))
    price, origin = c.soft.cost(s), Origin(c.name, f"soft {c.at}")
    if c.at == "path":
        draft.add_controls(AddedControls(s, box, sizes), origin)
        draft.running_cost += price
    else:
        zero = np.zeros(c.size)
        slack = AddedStates.constant(draft.ocp, s, zero, size=sizes, box=box)
        draft.add_states(slack, origin)
        draft.terminal_cost += price
    for rows, expression, low, high in slackened(c.expression, c.box, s):
        if rows:
            draft.constraints.append(
                Constraint(
                    draft.unused(c.name, origin),
                    expression,
                    low,
                    high,
                    at=c.at,
                    nominal=sizes[rows],
                    limits_input=False if c.at == "path" else None,
                )
            )


def _add_square(draft: Draft, c: Constraint) -> None:
    assert c.soft is not None
    price = c.soft.cost(excess(c))
    if c.at == "path":
        draft.running_cost += price
    else:
        draft.terminal_cost += price
    if not c.is_equation:
        draft.smoothness = min(draft.smoothness, 1)
