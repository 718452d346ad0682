"""Kinks in a control: where a slope jumps that a method differentiates."""

import casadi as ca
import numpy as np

from ocp.checks.expressions import readable
from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.problem.walk import operations

# Random controls between which a kink is looked for, and halvings of their distance.
_CONTROLS, _HALVINGS = 12, 45
# A slope that changes by more than this share of its size has a kink.
_KINK = 1e-6


@once_per_problem
def kink_in_control(ocp: OCP) -> str | None:
    """Return a term of running cost or dynamics with a kink in a control, as text, or None.

    Slopes in the controls are compared on both sides of every switch, at the start and a few
    random controls.
    """
    m, rng = ocp.model, np.random.default_rng(0)
    terms = ca.vertcat(ca.SX(ocp.running_cost), m.f)
    inputs, p = [m.x, m.u, m.t, ocp.p], ocp.parameter_values().at(0.0)[0]
    slope = ca.Function("slope", inputs, [ca.densify(ca.jacobian(terms, m.u))])
    controls = ocp.control_bounds.clip(rng.normal(size=(_CONTROLS, m.nu)) * 3.0)
    for node in operations(terms):
        difference = _difference(node)
        if difference is None or not ca.depends_on(difference, m.u):
            continue
        switch = ca.Function("switch", inputs, [difference])
        sides = [float(switch(ocp.start(), u, 0.0, p)) for u in controls]
        below, above = int(np.argmin(sides)), int(np.argmax(sides))
        if not sides[below] < 0.0 < sides[above]:
            continue
        low, high = controls[below], controls[above]
        for _ in range(_HALVINGS):
            middle = (low + high) / 2.0
            is_below = float(switch(ocp.start(), middle, 0.0, p)) < 0.0
            low, high = (middle, high) if is_below else (low, middle)
        left, right = (np.array(slope(ocp.start(), u, 0.0, p)) for u in (low, high))
        if np.abs(right - left).max() > _KINK * (1.0 + np.abs(left).max()):
            return readable(node)
    return None


def _difference(node: ca.SX) -> ca.SX | None:
    """Return what is zero where a node has its kink."""
    if node.op() in (ca.OP_FABS, ca.OP_SIGN):
        return node.dep(0)
    if node.op() in (ca.OP_FMAX, ca.OP_FMIN, ca.OP_LT, ca.OP_LE):
        return node.dep(0) - node.dep(1)
    return None
