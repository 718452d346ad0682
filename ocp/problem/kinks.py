"""Absolute values, maxima and minima: kinks in a control, and costs written without them."""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp.checks.errors import ProblemError, UnsupportedProblem
from ocp.checks.expressions import readable
from ocp.problem.cache import once_per_problem
from ocp.problem.constraint import Box, Constraint
from ocp.problem.guess import Guess
from ocp.problem.ocp import OCP
from ocp.problem.switches import operations

_MAXIMA = (ca.OP_FABS, ca.OP_FMAX, ca.OP_FMIN)
# Random controls between which a kink is looked for, and halvings of their distance.
_CONTROLS, _HALVINGS = 12, 45
# A slope that changes by more than this share of its size has a kink.
_KINK = 1e-6
# Instants at which the weight of a maximum is checked.
_INSTANTS = 21


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


def without_kinks(ocp: OCP) -> OCP:
    r"""Return the problem with slack controls in place of maxima in its running cost.

    .. math::

        \min \int \max(a, b) \, dt \quad \Leftrightarrow \quad
        \min \int s \, dt \;\; \text{s.t.} \;\; s \ge a, \; s \ge b

    and abs(a) = max(a, -a), min(a, b) = -max(-a, -b). The optimum is the same, and smooth where
    a and b are: Newton's method converges on it. Each maximum must enter the running cost with a
    weight that is not negative (a minimum: not positive) and contains no state and no control.
    The slack controls are appended to the controls of the model.

    Args:
        ocp: the problem; its terminal cost, dynamics and constraints stay as they are.

    Raises:
        UnsupportedProblem: naming the maximum whose weight is negative or varies.
        ProblemError: where there is no maximum.
    """
    m = ocp.model
    rewritten = _Rewritten.of(ocp)
    s = ca.vertcat(ca.SX(0, 1), *rewritten.slacks)
    if not rewritten.slacks:
        raise ProblemError(f"{ocp.name}: its running cost has no absolute value or maximum")
    _check_weights(ocp, rewritten, s)
    many = np.full(s.numel(), np.inf)
    box, guess = ocp.control_bounds, ocp.guess
    if guess is not None and guess.u is not None:
        rows = np.atleast_2d(np.asarray(guess.u, dtype=float))
        guess = Guess(
            x=guess.x,
            u=np.hstack([rows, np.zeros((len(rows), s.numel()))]),
            costate=guess.costate,
            duration=guess.duration,
        )
    units = (*m.u_units, *[""] * s.numel()) if m.u_units else ()
    above = tuple(
        Constraint(f"slack {i}", expression, 0.0)
        for i, expression in enumerate(rewritten.constraints)
    )
    return replace(
        ocp,
        model=replace(m, u=ca.vertcat(m.u, s), u_units=units),
        running_cost=rewritten.cost,
        control_bounds=Box(np.append(box.lower, -many), np.append(box.upper, many)),
        constraints=(*ocp.constraints, *above),
        smoothness=2,
        guess=guess,
    )


@dataclass(frozen=True, eq=False)
class _Rewritten:
    """A cost in which every maximum is a symbol s; each of the constraints is to be positive."""

    cost: ca.SX
    slacks: list[ca.SX]
    constraints: list[ca.SX]
    said: list[str]

    @classmethod
    def of(cls, ocp: OCP) -> "_Rewritten":
        """Walk the operations of the running cost."""
        m = ocp.model
        symbols, varying = ca.vertcat(m.x, m.u, m.t, ocp.p), ca.vertcat(m.x, m.u)
        function = ca.Function("cost", [symbols], [ca.SX(ocp.running_cost)])
        slacks: list[ca.SX] = []
        constraints: list[ca.SX] = []
        said: list[str] = []
        work, cost = [ca.SX(0)] * function.sz_w(), ca.SX(0)
        for k in range(function.n_instructions()):
            operation = function.instruction_id(k)
            at, to = function.instruction_input(k), function.instruction_output(k)
            if operation == ca.OP_CONST:
                work[to[0]] = ca.SX(function.instruction_constant(k))
            elif operation == ca.OP_INPUT:
                work[to[0]] = symbols[at[1]]
            elif operation == ca.OP_OUTPUT:
                cost = work[at[0]]
            else:
                values = [work[i] for i in at]
                plain = _applied(operation, values)
                unknowns = ca.vertcat(varying, *slacks)
                if operation in _MAXIMA and ca.depends_on(ca.vertcat(*values), unknowns):
                    s = ca.SX.sym(f"s_{len(slacks)}")
                    sign = -1.0 if operation == ca.OP_FMIN else 1.0
                    others = [-values[0]] if operation == ca.OP_FABS else [values[1]]
                    constraints.extend(s - sign * value for value in (values[0], *others))
                    slacks.append(s)
                    said.append(readable(plain))
                    plain = sign * s
                work[to[0]] = plain
        return cls(cost, slacks, constraints, said)


def _applied(operation: int, values: list[ca.SX]) -> ca.SX:
    """Return an operation of one or two arguments."""
    if len(values) == 1:
        return ca.SX.unary(operation, values[0])
    return ca.SX.binary(operation, *values)


def _check_weights(ocp: OCP, rewritten: _Rewritten, s: ca.SX) -> None:
    """Refuse a maximum that a minimiser would not push onto its larger argument."""
    m = ocp.model
    rows = ca.vertcat(rewritten.cost, *[-c for c in rewritten.constraints])
    slopes = ca.densify(ca.jacobian(rows, s))
    if ca.depends_on(slopes, ca.vertcat(m.x, m.u, s)):
        raise UnsupportedProblem(
            f"{ocp.name}: the weight of {', '.join(rewritten.said)} in the running cost contains a "
            "state or a control, so slack controls do not replace it"
        )
    function, values = ca.Function("slopes", [m.t, ocp.p], [slopes]), ocp.parameter_values()
    for fraction in np.linspace(0.0, 1.0, _INSTANTS):
        found = np.array(function(fraction * ocp.duration, values.at(fraction)[0]))
        # A slack has the slope -1 in its own two rows, minus the constraints.
        own = np.vstack([np.zeros(s.numel()), np.repeat(-np.eye(s.numel()), 2, axis=0)])
        wrong = np.flatnonzero(((found - own) < 0.0).any(axis=0))
        if wrong.size:
            raise UnsupportedProblem(
                f"{ocp.name}: {rewritten.said[wrong[0]]} enters the running cost with a negative "
                "weight, so its minimum is not convex and slack controls do not replace it"
            )


def _difference(node: ca.SX) -> ca.SX | None:
    """Return what is zero where a node has its kink."""
    if node.op() in (ca.OP_FABS, ca.OP_SIGN):
        return node.dep(0)
    if node.op() in (ca.OP_FMAX, ca.OP_FMIN, ca.OP_LT, ca.OP_LE):
        return node.dep(0) - node.dep(1)
    return None
