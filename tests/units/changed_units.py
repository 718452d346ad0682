"""A problem posed again in other units: every state, control, row, time and the cost."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp import OCP, Box, Constraint, FreeTime, Guess, Model, Solution


@dataclass(frozen=True, eq=False)
class Units:
    """What one old unit is in new ones."""

    x: np.ndarray
    u: np.ndarray
    t: float
    cost: float
    rows: dict[str, np.ndarray]

    @classmethod
    def drawn(cls, ocp: OCP, seed: int, decades: int = 6) -> "Units":
        """Draw powers of ten."""
        rng = np.random.default_rng(seed)

        def powers(size: int) -> np.ndarray:
            return 10.0 ** rng.integers(-decades, decades + 1, size=size)

        x, u, cost = powers(ocp.model.nx), powers(ocp.model.nu), float(powers(1)[0])
        t = 1.0 if ocp.model.is_discrete else float(powers(1)[0])
        return cls(x, u, t, cost, {c.name: powers(c.size) for c in ocp.constraints})

    def of(self, ocp: OCP) -> OCP:
        """Return the problem in the new units."""
        m = ocp.model
        old = ca.vertcat(m.x / self.x, m.u / self.u, m.t / self.t)

        def anew(expression: ca.SX | float) -> ca.SX:
            return ca.substitute(ca.SX(expression), ca.vertcat(m.x, m.u, m.t), old)

        step = 1.0 if m.is_discrete else self.t
        return OCP(
            name=ocp.name,
            model=Model(
                name=m.name, x=m.x, u=m.u, t=m.t, dt=m.dt, f=anew(m.f) * ca.DM(self.x) / step
            ),
            x0=np.asarray(ocp.x0) * self.x,
            horizon=self._horizon(ocp),
            running_cost=anew(ocp.running_cost) * self.cost / step,
            terminal_cost=anew(ocp.terminal_cost) * self.cost,
            control_bounds=_box(ocp.control_bounds, self.u),
            state_bounds=_box(ocp.state_bounds, self.x),
            constraints=tuple(
                self._constraint(c, anew(c.expression) / (step if c.at == "integral" else 1.0))
                for c in ocp.constraints
            ),
            parameters=ocp.parameters,
            smoothness=ocp.smoothness,
            guess=self._guess(ocp.guess),
        )

    def back(self, solution: Solution, original: OCP) -> Solution:
        """Return a solution in the old units."""
        return solution.with_(
            problem=original,
            t=solution.t / self.t,
            x=solution.x / self.x,
            x0=solution.x0 / self.x,
            u=solution.u / self.u,
            costate=solution.costate * self.x / self.cost,
            cost=solution.cost / self.cost,
        )

    def _horizon(self, ocp: OCP) -> FreeTime | float | int:
        horizon = ocp.horizon
        if isinstance(horizon, FreeTime):
            return FreeTime(horizon.guess * self.t, horizon.lower * self.t, horizon.upper * self.t)
        return horizon if ocp.model.is_discrete else horizon * self.t

    def _constraint(self, c: Constraint, expression: ca.SX) -> Constraint:
        unit = self.rows[c.name]
        lower, upper = np.asarray(c.lower) * unit, np.asarray(c.upper) * unit
        return Constraint(c.name, expression * ca.DM(unit), lower, upper, at=c.at)

    def _guess(self, guess: Guess | None) -> Guess | None:
        if guess is None:
            return None
        units = {"x": self.x, "u": self.u, "costate": self.cost / self.x}
        parts = {name: getattr(guess, name) for name in units}
        given = {k: np.asarray(v) * units[k] for k, v in parts.items() if v is not None}
        duration = None if guess.duration is None else guess.duration * self.t
        return Guess(**given, duration=duration)


def _box(box: Box, unit: np.ndarray) -> Box:
    return Box(np.asarray(box.lower) * unit, np.asarray(box.upper) * unit)
