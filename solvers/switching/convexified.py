r"""The relaxed problem: the shares of the modes are its controls.

With the modes :math:`v^1, \dots, v^M` of the controls that have levels, and the other controls w,

.. math::
    \dot x = \sum_i \alpha_i f(x, w, v^i, t), \quad L = \sum_i \alpha_i L(x, w, v^i, t), \quad
    \alpha_i \ge 0, \; \sum_i \alpha_i = 1

(partial outer convexification). It contains every switching as the shares 0 and 1, so that its
optimum is a lower bound; it is affine in the shares whatever the dynamics are in v. The last share
is what the others leave. Source: [Sager 2009].
"""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint, Guess
from ocp.internal import Steps
from solvers.switching.modes import Modes


@dataclass(frozen=True, eq=False)
class Convexified:
    """A problem with levels, and the two problems that are made of it.

    Attributes:
        ocp: as it was written.
        modes: of it.
    """

    ocp: OCP
    modes: Modes

    @property
    def kept(self) -> list[int]:
        """Which controls have no levels."""
        return [i for i in range(self.ocp.model.nu) if i not in self.modes.index]

    def relaxed(self) -> OCP:
        """Return the problem in the shares, behind the controls that have no levels."""
        ocp, kept, count = self.ocp.explicit, self.kept, self.modes.count
        share = ca.vertcat(*[ca.SX.sym(f"share of mode {i + 1}") for i in range(count - 1)])
        every = ca.vertcat(share, 1 - ca.sum1(share))
        v = ocp.model.u[list(self.modes.index), :]

        def mixed(expression: ca.SX | float) -> ca.SX:
            whole = ca.SX(expression)
            if not ca.depends_on(whole, v):
                return whole
            each = [ca.substitute(whole, v, ca.DM(value)) for value in self.modes.values]
            return sum((every[i] * each[i] for i in range(count)), ca.SX.zeros(whole.shape))

        terms = ocp.terms(mixed)
        constraints = [c for c in terms["constraints"] if c.name not in self.modes.limits]
        if count > 2:
            names = {c.name for c in (*ocp.constraints, *ocp.invariants)}
            name = "shares" if "shares" not in names else "shares of the modes"
            constraints.append(Constraint(name, ca.sum1(share), upper=1.0))
        model, box = ocp.model, ocp.control_bounds
        nominal = model.u_nominal
        if nominal is not None:
            own = np.broadcast_to(np.asarray(nominal, dtype=float), model.nu)[kept]
            nominal = np.append(own, np.ones(count - 1))
        units = (*(model.u_units[i] for i in kept), *[""] * (count - 1)) if model.u_units else ()
        return replace(
            ocp,
            name=f"{ocp.name}, relaxed",
            model=replace(
                model,
                u=ca.vertcat(model.u[kept, :], share),
                f=mixed(model.f),
                u_units=units,
                u_nominal=nominal,
            ),
            control_bounds=box[kept] & Box(np.zeros(count - 1), np.ones(count - 1)),
            **terms | {"constraints": tuple(constraints)},
            guess=self._guess(),
        )

    def shares(self, u: np.ndarray) -> np.ndarray:
        """Return the shares of all modes (N, M) of controls of the relaxed problem (N, nu)."""
        own = np.clip(u[:, len(self.kept) :], 0.0, 1.0)
        last = np.clip(1.0 - own.sum(axis=1, keepdims=True), 0.0, 1.0)
        every = np.hstack([own, last])
        return every / every.sum(axis=1, keepdims=True)

    def fixed(self, chosen: np.ndarray, fractions: np.ndarray, x: np.ndarray) -> OCP:
        """Return the problem with a mode on each interval, in the other controls alone.

        Args:
            chosen: the mode of each interval, int (N,).
            fractions: of the horizon, where they begin and end, (N + 1,).
            x: states to start from (N + 1, nx).
        """
        ocp, kept = self.ocp, self.kept
        model = ocp.model
        v, values = model.u[list(self.modes.index), :], self.modes.values[chosen]
        taken = {entry.name for entry in (*ocp.parameters, *ocp.unknowns)}
        name = next(n for n in ("levels", "levels of controls") if n not in taken)
        nominal = model.u_nominal
        if nominal is not None:
            nominal = np.broadcast_to(np.asarray(nominal, dtype=float), model.nu)[kept]
        return replace(
            ocp,
            name=f"{ocp.name}, rounded",
            model=replace(
                model,
                u=model.u[kept, :],
                u_units=tuple(model.u_units[i] for i in kept) if model.u_units else (),
                u_nominal=nominal,
            ),
            control_bounds=ocp.control_bounds[kept],
            constraints=tuple(c for c in ocp.constraints if c.name not in self.modes.limits),
            parameters=(*ocp.parameters, Steps(name, v, fractions[1:-1], values)),
            guess=Guess(x=x),
        )

    def controls(self, chosen: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return all controls (N, nu) for modes (N,) and the controls without levels (N, k)."""
        u = np.zeros((len(chosen), self.ocp.model.nu))
        u[:, list(self.modes.index)] = self.modes.values[chosen]
        u[:, self.kept] = others
        return u

    def _guess(self) -> Guess | None:
        """Return the guess without controls that have levels: of the states alone."""
        guess = self.ocp.guess
        return None if guess is None or guess.x is None else replace(guess, u=None, costate=None)
