r"""Constraints at instants, as bounds at the end of states that remember.

.. math::
    \dot q = -1_{t > \tau} \, \dot c, \quad q(t_0) = 0, \quad
    \underline c \le c(x(t_f), t_f) + q(t_f) \le \overline c, \qquad \dot c = c_x f + c_t ,

since c(x(t), t) + q(t) stays what c was at the instant tau. The costate of q never changes and is
the multiplier of the instant; that of x jumps by c_x' times it where it comes back. In discrete
time q takes up the value at its step.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.normal_form.draft import AddedStates, Draft
from ocp.normal_form.origin import Origin
from ocp.problem.constraint import Box, Constraint
from ocp.problem.portable import Portable
from ocp.problem.scaled import sizes_of

# Instants nearer to an end than this, in fractions of the horizon, are it.
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Waypoints(Portable):
    """What constraints at instants have added.

    Attributes:
        places: where the states of each constraint stand, by its name.
        prices: symbols of their costates, in this order.
        jump: what the costates of the original are less by, (nx,), in these too.
    """

    places: dict[str, slice]
    prices: ca.SX
    jump: ca.SX


def add_waypoints(draft: Draft) -> Waypoints:
    """Replace every constraint at instants."""
    places, prices = {}, [ca.SX(0, 1)]
    jump = ca.SX.zeros(draft.ocp.model.nx)
    for c in [c for c in draft.constraints if c.at == "instants"]:
        draft.constraints.remove(c)
        price = ca.SX.sym(f"price of {c.name}", c.size * len(c.instants))
        places[c.name], passed = _add(draft, c)
        prices.append(price)
        slope = ca.jacobian(_known(draft, c), draft.ocp.model.x).T
        for i, each in enumerate(ca.vertsplit(price, c.size)):
            jump += passed[i] * (slope @ each)
    return Waypoints(places, ca.vertcat(*prices), jump)


def _add(draft: Draft, c: Constraint) -> tuple[slice, ca.SX]:
    """Add the states of one constraint; return where they stand, and which instants have passed."""
    ocp, m, count = draft.ocp, draft.ocp.model, len(c.instants)
    value, f = _known(draft, c), ocp.algebraic_solution(m.f)
    fractions = np.minimum(c.instants / ocp.duration, 1.0)
    names = [f"{c.name} at {t:g} s" for t in c.instants]
    q = [ca.vertcat(*[ca.SX.sym(f"{name}, {k}") for k in range(c.size)]) for name in names]
    flags = ca.SX.sym(f"instants of {c.name}", count)
    if ocp.model.is_discrete:
        steps = ocp.steps or 1
        at = np.round(fractions * steps).astype(int)
        edges = (np.arange(steps) + 0.5) / steps
        levels = (np.arange(steps + 1)[:, None] == at).astype(float)
        rates = [q[i] + flags[i] * value for i in range(count)]
        values = [q[i] + (value if at[i] == steps else 0) for i in range(count)]
    else:
        edges = np.unique(fractions[(fractions > _SAME) & (fractions < 1.0 - _SAME)])
        levels = np.array([fractions <= edge + _SAME for edge in (0.0, *edges)], dtype=float)
        change = ca.jacobian(value, m.x) @ f + ca.jacobian(value, m.t)
        rates = [-flags[i] * change for i in range(count)]
        values = [value + q[i] for i in range(count)]
    sizes = sizes_of(ocp).rows[c.name]
    draft.add_steps(f"instants of {c.name}", flags, edges, levels)
    origins = [Origin(c.name, "waypoint", float(t)) for t in c.instants]
    for name, kept, origin in zip(names, values, origins, strict=True):
        own = draft.unused(name, origin)
        draft.constraints.append(
            Constraint(own, kept, c.lower, c.upper, at="terminal", nominal=sizes)
        )
    total = c.size * count
    place = draft.add_states(
        AddedStates(
            symbol=ca.vertcat(*q),
            rate=ca.vertcat(*rates),
            start=np.zeros(total),
            is_free=False,
            box=Box.unbounded(total),
            size=np.tile(sizes, count),
        ),
        *[origin for origin in origins for _ in range(c.size)],
    )
    return place, ca.SX.zeros(count) if ocp.model.is_discrete else flags


def _known(draft: Draft, c: Constraint) -> ca.SX:
    """Return the expression of a constraint without algebraic variables: it is differentiated."""
    return draft.ocp.algebraic_solution(c.expression)
