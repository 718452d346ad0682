r"""The problem whose states may exceed what limits them, at a high price.

.. math::

    \min \; J + w \int s + \tfrac12 s^2 \, dt + w \, T \, |e(x(t_f))|^2 \quad \text{s.t.} \quad
    \underline c - S s \le c(x, u, t) \le \overline c + S s, \quad s \ge 0

for the rows c that are hard: bounds of states and path constraints that do not limit the input. S
are their nominal sizes, e the relative excess of these rows and of the terminal constraints at the
end, where no control acts. The penalty is exact along the way where w exceeds the multipliers
[Nocedal & Wright 2006, section 17.2].
"""

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.problem.constraint import Box, Constraint, unused
from ocp.problem.constraint_rows import ConstraintRows
from ocp.problem.ocp import OCP
from ocp.problem.portable import Portable
from ocp.problem.scaled import sizes_of
from ocp.problem.soft import slackened

# Weight of a violation of one nominal size all along, relative to the nominal cost.
_PRICE = 1e4
_NAME = "excess"


def elastic(ocp: OCP) -> "Elastic | None":
    """Return the problem with a slack control for its hard rows, or None where it has none."""
    rows = ocp.rows
    hard = [part for part in (rows.states, rows.path, rows.terminal) if _hard(part)]
    return Elastic(ocp) if hard else None


@dataclass(frozen=True, eq=False)
class Elastic(Portable):
    """A problem that no trajectory may meet, and the one that it violates least.

    Attributes:
        original: the problem as it was written.
    """

    original: OCP

    @cached_property
    def problem(self) -> OCP:
        """The problem whose last control is the slack."""
        ocp, m = self.original, self.original.model
        s, rows = ca.SX.sym(_NAME), self._along
        weight, unit = ca.DM(self.penalty), self._sizes
        box = Box(np.asarray(rows.box.lower) / unit, np.asarray(rows.box.upper) / unit)
        above, below = slackened(rows.expression / ca.DM(unit), box, s)
        kept = [c for c in ocp.constraints if c.at == "initial" or c.soft is not None]
        names = {c.name for c in (*kept, *ocp.invariants)}
        inputs = ocp.rows.path.of_kind("input")
        for name, expression, low, high, limits_input in (
            ("input", inputs.expression, inputs.box.lower, inputs.box.upper, True),
            ("upper", *above[1:], None),
            ("lower", *below[1:], None),
        ):
            if expression.numel():
                own = unused(name, names)
                kept.append(Constraint(own, expression, low, high, limits_input=limits_input))
        return replace(
            ocp,
            name=f"{ocp.name}, least violation",
            model=replace(
                m,
                u=ca.vertcat(m.u, s),
                u_units=(*m.u_units, "") if m.u_units else (),
                u_nominal=None if m.u_nominal is None else np.append(m.u_nominal, 1.0),
            ),
            running_cost=ca.SX(ocp.running_cost) + weight * (s + s**2 / 2),
            terminal_cost=ca.SX(ocp.terminal_cost) + weight * self._horizon * self._at_end,
            control_bounds=ocp.control_bounds & Box([0.0], [np.inf]),
            state_bounds=Box(),
            constraints=tuple(kept),
            smoothness=min(ocp.smoothness, 1),
            guess=None,
        )

    @property
    def penalty(self) -> float:
        """The price w of a relative violation, per second or step."""
        return _PRICE * sizes_of(self.original).cost / self._horizon

    @property
    def _horizon(self) -> float:
        """What the running cost is summed over: seconds, or steps."""
        return float(self.original.steps or self.original.duration)

    def slacks(self, fractions: np.ndarray, x: np.ndarray | None, u: np.ndarray) -> np.ndarray:
        """Return the slack of a first guess: none, (len(fractions), 1)."""
        return np.zeros((len(u), 1))

    @cached_property
    def _along(self) -> ConstraintRows:
        """The hard rows at every instant."""
        return self.original.rows.states + self.original.rows.path.of_kind("hard")

    @cached_property
    def _sizes(self) -> np.ndarray:
        sizes, path = sizes_of(self.original), self.original.rows.path
        hard = np.array([row.kind == "hard" for row in path.rows], dtype=bool)
        return np.concatenate([sizes.x, sizes.of_rows(path)[hard]])

    @cached_property
    def _at_end(self) -> ca.SX:
        """The squared relative excess at the end, where no control acts."""
        terminal, free = self.original.rows.terminal, ~self._along.on_control
        both = self._along.where(free) + terminal
        ends = sizes_of(self.original).of_rows(terminal)
        unit = np.concatenate([self._sizes[free], ends])
        total = ca.SX(0)
        for row, value, size in zip(
            both.rows, ca.vertsplit(both.expression), unit.tolist(), strict=True
        ):
            if row.is_equation:
                total += ((value - row.lower) / size) ** 2
                continue
            if np.isfinite(row.upper):
                total += ca.fmax(0.0, (value - row.upper) / size) ** 2
            if np.isfinite(row.lower):
                total += ca.fmax(0.0, (row.lower - value) / size) ** 2
        return total


def _hard(rows: ConstraintRows) -> bool:
    return rows.of_kind("hard").is_imposed
