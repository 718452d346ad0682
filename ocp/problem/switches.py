"""Where dynamics, running cost and path constraints may jump: the switches in their expressions."""

from dataclasses import dataclass

import casadi as ca

from ocp.checks.expressions import readable
from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.problem.walk import operations

_COMPARISONS = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE)
# A condition made of comparisons has these as switches, not itself.
_CONDITIONS = (*_COMPARISONS, ca.OP_NOT, ca.OP_AND, ca.OP_OR)


@dataclass(frozen=True, eq=False)
class Switches:
    """The switches of a problem that depend on a state or a control, m of them.

    Attributes:
        levels: (x, u, t, p) -> which branch of each is taken, a whole number, (m,).
        values: (x, u, t, p) -> everything that may jump: rates, running cost, path constraints.
        names: what each of these values is called.
        labels: each switch as text.
    """

    levels: ca.Function
    values: ca.Function
    names: tuple[str, ...]
    labels: tuple[str, ...]


@once_per_problem
def switches(ocp: OCP) -> Switches | None:
    """Return the switches of a problem, or None if there is none.

    A comparison (``if_else`` has one as its condition), ``sign``, ``floor``, ``ceil``, ``fmod``,
    ``remainder``, ``copysign`` and the branch cut of ``atan2``. ``fabs``, ``fmax`` and ``fmin``
    are continuous: they have kinks, no jumps. Switches in time and parameters alone are left
    out: they happen at instants that are known.
    """
    m, rows = ocp.model, ocp.rows.path
    terms = [m.f, ca.SX(ocp.running_cost), *[c.expression for c in ocp.at("path")]]
    inputs, varying = [m.x, m.u, m.t, ocp.p], ca.vertcat(m.x, m.u)
    found: dict[int, tuple[ca.SX, str]] = {}
    for node in operations(ca.vertcat(*terms)):
        level = _level(node)
        if level is not None and ca.depends_on(level, varying):
            found.setdefault(node.element_hash(), (level, readable(node)))
    if not found:
        return None
    names = [f"the rate of {name}" for name in m.x_names]
    names += ["the running cost", *[f"path constraint '{row.name}'" for row in rows.rows]]
    levels, labels = zip(*found.values(), strict=True)
    return Switches(
        levels=ca.Function("levels", inputs, [ca.densify(ca.vertcat(*levels))]),
        values=ca.Function("values", inputs, [ca.densify(ca.vertcat(*terms))]),
        names=tuple(names),
        labels=labels,
    )


def _level(node: ca.SX) -> ca.SX | None:
    """Return the number of the branch that a node takes; None where it has one branch only."""
    operation = node.op()
    if operation in _COMPARISONS or operation in (ca.OP_SIGN, ca.OP_FLOOR, ca.OP_CEIL):
        return node
    if operation == ca.OP_IF_ELSE_ZERO and node.dep(0).op() not in _CONDITIONS:
        return node.dep(0) != 0
    if operation == ca.OP_FMOD:
        quotient = node.dep(0) / node.dep(1)
        return ca.sign(quotient) * ca.floor(ca.fabs(quotient))
    if operation == ca.OP_REMAINDER:
        return ca.floor(node.dep(0) / node.dep(1) + 0.5)
    if operation == ca.OP_COPYSIGN:
        return node.dep(1) < 0
    if operation == ca.OP_ATAN2:
        return (node.dep(0) < 0) * (node.dep(1) < 0)
    return None
