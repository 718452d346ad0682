r"""Costs with absolute values, maxima and minima, written without their kinks.

.. math::

    \min \int \max(a, b) \, dt \quad \Leftrightarrow \quad
    \min \int s \, dt \;\; \text{s.t.} \;\; s \ge a, \; s \ge b
"""

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.checks.errors import ProblemError, UnsupportedProblem
from ocp.checks.expressions import readable
from ocp.problem.along_guess import along_guess
from ocp.problem.constraint import Box, Constraint, unused
from ocp.problem.guess import Guess
from ocp.problem.ocp import OCP
from ocp.problem.parameters import ParameterValues
from ocp.problem.walk import applied, walk

_MAXIMA = (ca.OP_FABS, ca.OP_FMAX, ca.OP_FMIN)
# Instants at which a guess is sampled.
_INSTANTS = 21
# Instants at which the weight of a maximum is looked at.
_LOOKS = 201


def without_kinks(ocp: OCP) -> OCP:
    r"""Return the problem with slack controls in place of maxima in its running cost.

    .. math::

        \min \int \max(a, b) \, dt \quad \Leftrightarrow \quad
        \min \int s \, dt \;\; \text{s.t.} \;\; s \ge a, \; s \ge b

    and abs(a) = max(a, -a), min(a, b) = -max(-a, -b). The optimum is the same, and smooth where
    a and b are: Newton's method converges on it. A maximum is replaced that enters the running
    cost with a weight that is not negative (a minimum: not positive), contains no state and no
    control, and is affine in signals; others stay. The slack controls are appended to the controls
    of the model.

    ``MultipleShooting``, ``BetweenNodes`` and ``Collocation`` do it by themselves where their grid
    treats the slack controls exactly.

    Args:
        ocp: the problem; its terminal cost, dynamics and constraints stay as they are.

    Raises:
        UnsupportedProblem: naming the maximum whose weight is negative or varies, where none can
            be replaced.
        ProblemError: where there is no maximum.
    """
    everything = _Rewritten.of(ocp, frozenset())
    if not everything.slacks:
        raise ProblemError(f"{ocp.name}: its running cost has no absolute value or maximum")
    found = epigraph(ocp)
    if found is None or not found.holds(ocp.parameter_values()):
        raise UnsupportedProblem(everything.refusal(ocp))
    return found.problem


def epigraph(ocp: OCP, *, held: bool = False) -> "Epigraph | None":
    """Return the problem with slack controls, and the way back; None where nothing is replaced.

    Args:
        ocp: the problem.
        held: replace only maxima of what does not change while the controls are held: a held
            slack is then exact.
    """
    left: frozenset[int] = frozenset()
    if not _has_maximum(ocp):
        return None
    fixed = _changing(ocp) if held else None
    while True:
        rewritten = _Rewritten.of(ocp, left, fixed)
        unfit = rewritten.unfit(ocp)
        if not unfit:
            break
        left |= unfit
    return Epigraph(ocp, rewritten) if rewritten.slacks else None


@dataclass(frozen=True, eq=False)
class Epigraph:
    """A problem whose cost has kinks, and the same one without them.

    Attributes:
        original: the problem as it was written.
        rewritten: its running cost with slacks.
    """

    original: OCP
    rewritten: "_Rewritten"

    @cached_property
    def problem(self) -> OCP:
        """The problem whose last controls are the slacks."""
        ocp, m, s = self.original, self.original.model, self.rewritten.s
        names = {c.name for c in (*ocp.constraints, *ocp.invariants)}
        above = tuple(
            Constraint(unused(f"slack {i}", names), expression, 0.0)
            for i, expression in enumerate(self.rewritten.constraints)
        )
        units = (*m.u_units, *[""] * s.numel()) if m.u_units else ()
        nominal = m.u_nominal
        if nominal is not None:
            nominal = np.append(np.broadcast_to(nominal, m.nu), np.ones(s.numel()))
        return replace(
            ocp,
            model=replace(m, u=ca.vertcat(m.u, s), u_units=units, u_nominal=nominal),
            running_cost=self.rewritten.cost,
            control_bounds=ocp.control_bounds & Box.unbounded(s.numel()),
            constraints=(*ocp.constraints, *above),
            smoothness=ocp.smoothness if self.rewritten.left else 2,
            guess=None if ocp.guess is None else self._extended(ocp.guess),
        )

    def _extended(self, guess: Guess) -> Guess:
        """Return a guess with the slacks beside its controls."""
        if guess.u is None:
            return guess
        fractions = np.linspace(0.0, 1.0, max(len(np.atleast_2d(guess.u)), _INSTANTS))
        u = guess.sample("u", fractions, self.original.model.nu)
        assert u is not None
        x = guess.sample("x", fractions, self.original.model.nx)
        return replace(guess, u=np.hstack([u, self.slacks(fractions, x, u)]))

    def slacks(self, fractions: np.ndarray, x: np.ndarray | None, u: np.ndarray) -> np.ndarray:
        """Return the slacks that touch their maxima, (len(fractions), n).

        Args:
            fractions: of the horizon, (k,).
            x: states, (k, nx); None: the start.
            u: controls, (k, nu).
        """
        return along_guess(self.original, self._maxima, fractions, x, u)

    @cached_property
    def _maxima(self) -> ca.Function:
        m = self.original.model
        maxima = ca.vertcat(*self.rewritten.maxima)
        return ca.Function("maxima", [m.x, m.u, m.t, self.original.p], [maxima])

    @property
    def depends_on_data(self) -> bool:
        """Whether parameters or the time decide if it holds."""
        unknown = ca.vertcat(self.original.model.t, self.original.p)
        return ca.depends_on(self.rewritten.weights, unknown)

    def holds(self, values: ParameterValues, t0: float = 0.0) -> bool:
        """Whether no weight is negative with these parameters, so that each slack sinks.

        A weight is affine in signals, and these are extreme at their knots, on either side. In
        time it is looked at often; what is missed shows as a cost without a lower bound.
        """
        at = np.union1d(values.knots, np.linspace(0.0, 1.0, _LOOKS))
        t = np.tile(t0 + at * self.original.duration, 2)[None, :]
        p = np.vstack([values.at(at, 1), values.at(at, -1)]).T
        return bool((np.array(self._weights.map(t.size)(t, p)) >= 0.0).all())

    @cached_property
    def _weights(self) -> ca.Function:
        inputs = [self.original.model.t, self.original.p]
        return ca.Function("weights", inputs, [self.rewritten.weights])


@dataclass(frozen=True, eq=False)
class _Rewritten:
    """A running cost in which maxima are symbols.

    Attributes:
        cost: the running cost.
        slacks: the symbols s.
        constraints: two for each slack, s - a and s - b, to be positive.
        maxima: what each slack stands for, in terms of the original alone.
        nodes: which instruction of the original cost each slack replaces.
        left: the instructions that stay.
    """

    cost: ca.SX
    slacks: list[ca.SX]
    constraints: list[ca.SX]
    maxima: list[ca.SX]
    nodes: list[int]
    left: frozenset[int]

    @classmethod
    def of(cls, ocp: OCP, left: frozenset[int], fixed: ca.SX | None = None) -> "_Rewritten":
        """Walk the operations of the running cost.

        Args:
            ocp: the problem.
            left: instructions that stay.
            fixed: symbols of which no maximum that is replaced may contain any.
        """
        m = ocp.model
        symbols, varying = ca.vertcat(m.x, m.u, m.t, ocp.p), ca.vertcat(m.x, m.u)
        found, stay = cls(ca.SX(0), [], [], [], [], left), set(left)

        def node(
            k: int, operation: int, arguments: list[tuple[ca.SX, ca.SX]]
        ) -> tuple[ca.SX, ca.SX]:
            """With slacks, and as it was written."""
            values, written = ([pair[side] for pair in arguments] for side in (0, 1))
            original = applied(operation, written)
            # Only of a maximum it is asked what it depends on: a cost has thousands of operations.
            if operation not in _MAXIMA or k in left or not ca.depends_on(original, varying):
                return applied(operation, values), original
            if fixed is not None and ca.depends_on(original, fixed):
                stay.add(k)
                return applied(operation, values), original
            return found._replace(operation, values, original, k), original

        cost, _ = walk(ca.SX(ocp.running_cost), symbols, lambda leaf: (leaf, leaf), node)
        return replace(found, cost=cost, left=frozenset(stay))

    def _replace(self, operation: int, values: list[ca.SX], original: ca.SX, k: int) -> ca.SX:
        """Return a maximum as a new slack, a minimum as one with the other sign."""
        s, sign = ca.SX.sym(f"s_{len(self.slacks)}"), -1.0 if operation == ca.OP_FMIN else 1.0
        second = -values[0] if operation == ca.OP_FABS else values[1]
        self.constraints.extend(s - sign * value for value in (values[0], second))
        self.slacks.append(s)
        self.maxima.append(sign * original)
        self.nodes.append(k)
        return sign * s

    @property
    def s(self) -> ca.SX:
        """The slacks, stacked (n,)."""
        return ca.vertcat(ca.SX(0, 1), *self.slacks)

    @property
    def weights(self) -> ca.SX:
        """By how much cost and maxima grow with each slack, (1 + 2 n, n)."""
        rows = ca.vertcat(self.cost, *[-c for c in self.constraints])
        # A slack has the slope -1 in its own two rows, minus the constraints.
        own = ca.kron(ca.DM.eye(len(self.slacks)), ca.DM.ones(2, 1))
        # Backwards, what is called with other arguments stays out of it.
        slopes = ca.jacobian(rows, self.s, {"helper_options": {"ad_weight": 1.0}})
        return ca.densify(slopes) + ca.vertcat(ca.DM(1, len(self.slacks)), own)

    def unfit(self, ocp: OCP) -> frozenset[int]:
        """Return which maxima a slack does not replace, as instructions."""
        if not self.slacks:
            return frozenset()
        m, weights = ocp.model, self.weights
        unfit = set[int]()
        for j, node in enumerate(self.nodes):
            weight = weights[:, j]
            varies = ca.depends_on(weight, ca.vertcat(m.x, m.u, self.s))
            varies = varies or _bends(weight, ocp)
            varies = varies or weight.is_zero()  # it stands in the argument of a call
            if not varies and not ca.depends_on(weight, ca.vertcat(m.t, ocp.p)):
                varies = not (np.array(ca.evalf(weight)) >= 0.0).all()
            if varies:
                unfit.add(node)
        return frozenset(unfit)

    def refusal(self, ocp: OCP) -> str:
        """Return why no maximum can be replaced."""
        m, said = ocp.model, ", ".join(readable(each) for each in self.maxima)
        if ca.depends_on(self.weights, ca.vertcat(m.x, m.u, self.s)):
            return (
                f"{ocp.name}: the weight of {said} in the running cost contains a state or a "
                "control, so slack controls do not replace it"
            )
        return (
            f"{ocp.name}: {said} enters the running cost with a negative weight, so its minimum is "
            "not convex and slack controls do not replace it"
        )


def _has_maximum(ocp: OCP) -> bool:
    """Look before the walk, which takes its time on an arm."""
    cost = ca.SX(ocp.running_cost)
    function = ca.Function("cost", [ca.vertcat(*ca.symvar(cost))], [cost])
    return any(function.instruction_id(k) in _MAXIMA for k in range(function.n_instructions()))


def _bends(weight: ca.SX, ocp: OCP) -> bool:
    """Whether a weight is not affine in the signals: between knots it might be negative."""
    signals = [entry.symbol for entry in ocp.moving]
    if not signals:
        return False
    return any(ca.which_depends(ca.vec(weight), ca.vertcat(*signals), 2, True))


def _changing(ocp: OCP) -> ca.SX:
    """Return the symbols that change while the controls are held."""
    m = ocp.model
    if m.is_discrete:
        return ca.SX(0, 1)
    signals = [entry.symbol for entry in ocp.moving]
    return ca.vertcat(m.x, m.t, *signals)
