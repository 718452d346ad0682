"""Phases against the same chain written by hand in CasADi's Opti: optimum, build and resolve.

Both have states at nodes, held controls and a step of RK4 in every interval, the same backend with
the same tolerance, and the same first iterate. By hand each phase has states and controls of its
own and a link is a row between two of them; here all phases run side by side.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import process_time
from typing import Any

import casadi as ca
import numpy as np

from models import random_scenarios
from ocp import OCP, Box, Constraint, FreeTime, Guess, Link, Model, Phases
from ocp.internal import LinkRows
from solvers import MultipleShooting

_IPOPT = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-9,
    "ipopt.bound_relax_factor": 0.0,
}


@dataclass(frozen=True)
class Comparison:
    """One chain, here and by hand; times are processor times of this process [s].

    Attributes:
        name: of the chain.
        cost: here.
        cost_by_hand: by hand.
        build: time to build, here and by hand.
        resolve: median time of a run from the first iterate, here and by hand.
    """

    name: str
    cost: float
    cost_by_hand: float
    build: tuple[float, float]
    resolve: tuple[float, float]


# -- the chains -----------------------------------------------------------------------


def ball() -> Phases:
    """Return a ball that falls, loses a fifth of its speed at the ground, and comes back."""
    h, v, u = (ca.SX.sym(name) for name in ("height", "speed", "push"))
    model = Model(name="ball", x=ca.vertcat(h, v), u=u, f=ca.vertcat(v, u - 9.81))
    given: dict[str, Any] = {"model": model, "horizon": FreeTime(0.7), "running_cost": u**2 / 2}
    ground = Constraint("ground", h, 0, 0, at="terminal")
    top = Constraint("top", model.x, [1, 0], [1, 0], at="terminal")
    fall = OCP(name="fall", x0=[1, 0], constraints=(ground,), **given)
    rise = OCP(name="rise", x0=[0, 3], constraints=(top,), **given)
    return Phases("ball", (fall, rise), (Link(ca.vertcat(h, -0.8 * v)),), total=1.5)


def rocket() -> Phases:
    """Return two stages of a rocket; the second starts with a mass of its own."""
    h, v, m, u = (ca.SX.sym(name) for name in ("height", "speed", "mass", "push"))
    rate = ca.vertcat(v, u / m - 1 - 0.1 * v**2 * ca.exp(-h), -u / 2)
    model = Model(name="rocket", x=ca.vertcat(h, v, m), u=u, f=rate)
    given: dict[str, Any] = {
        "model": model,
        "control_bounds": Box(0, 3.5),
        "running_cost": 0.05 * u**2,
    }

    def left(mass: float) -> tuple[Constraint, ...]:
        return (Constraint("tank", m, lower=mass, at="terminal"),)

    first = OCP(name="first", x0=[0, 0, 1], horizon=0.6, constraints=left(0.7), **given)
    second = OCP(
        name="second",
        x0=[0, 0, 0.6],
        horizon=FreeTime(0.5, 0.2, 1.0),
        terminal_cost=-h,
        constraints=left(0.3),
        **given,
    )
    return Phases("rocket", (first, second), (Link(states=("height", "speed")),))


def arm(pieces: int = 8) -> Phases:
    """Return the motion of an arm, cut in pieces."""
    whole = random_scenarios(3, 1, seed=0)[0].ocp()
    names = [f"piece {i + 1}" for i in range(pieces)]
    horizon = whole.duration / pieces
    return Phases("arm", tuple(replace(whole, name=name, horizon=horizon) for name in names))


CHAINS: tuple[tuple[Callable[[], Phases], int], ...] = ((ball, 40), (rocket, 40), (arm, 10))


# -- by hand --------------------------------------------------------------------------


class ByHand:
    """A chain in CasADi's Opti, for phases of rates, costs, bounds, path and terminal constraints.

    Args:
        chain: the phases.
        intervals: of each phase.
    """

    def __init__(self, chain: Phases, intervals: int) -> None:
        self.opti, self.cost = ca.Opti(), ca.MX(0)
        self.states, self.ends = [], []
        t, durations = ca.MX(0), []
        for phase, linked in zip(chain.phases, chain.start_is_linked, strict=True):
            durations.append(self._duration(phase))
            t = self._phase(phase, linked, t, durations[-1], intervals)
        for rows in chain.couplings:
            self._link(chain, rows)
        if chain.total is not None:
            self.opti.subject_to(sum(durations) == chain.total)
        self.opti.minimize(self.cost)
        self.opti.solver("ipopt", _IPOPT)

    def run(self) -> float:
        """Solve from the first iterate, and return the optimum."""
        return float(self.opti.solve().value(self.opti.f))

    def _duration(self, phase: OCP) -> ca.MX:
        if not phase.has_free_time:
            return ca.MX(phase.duration)
        duration = self.opti.variable()
        self._bounded(duration, phase.time_box)
        self.opti.set_initial(duration, phase.duration)
        return duration

    def _phase(
        self, phase: OCP, linked: np.ndarray, t: ca.MX, duration: ca.MX, intervals: int
    ) -> ca.MX:
        opti, m, functions = self.opti, phase.model, phase.functions
        x, u = opti.variable(m.nx, intervals + 1), opti.variable(m.nu, intervals)
        opti.set_initial(x, np.tile(phase.start()[:, None], (1, intervals + 1)))
        p, h, step = phase.parameter_values().at(0.0)[0], duration / intervals, _rk4(phase)
        path = phase.rows.path
        for i in np.flatnonzero(~linked & ~phase.start_is_free).tolist():
            opti.subject_to(x[i, 0] == phase.start()[i])
        for k in range(intervals):
            now = t + k * h
            after, cost = step(x[:, k], u[:, k], now, h)
            opti.subject_to(x[:, k + 1] == after)
            self._bounded(u[:, k], phase.control_bounds)
            if len(path):
                self._bounded(functions.path(x[:, k], u[:, k], now, p), path.box)
            self.cost += cost
        end = t + duration
        self._bounded(x[:, 1:], phase.state_bounds)
        if len(phase.rows.terminal):
            self._bounded(functions.terminal(x[:, -1], end, p), phase.rows.terminal.box)
        self.cost += functions.terminal_cost(x[:, -1], end, p)
        self.states.append(x)
        return end

    def _link(self, chain: Phases, rows: LinkRows) -> None:
        before, after = (chain.phases[i].model for i in (rows.before, rows.after))
        link = ca.Function("link", [before.x, after.start], [rows.rows])
        end, start = self.states[rows.before][:, -1], self.states[rows.after][:, 0]
        self.opti.subject_to(link(end, start) == 0)

    def _bounded(self, values: ca.MX, box: Box) -> None:
        """Bound each row of values (n, K) that has a bound."""
        for i, (low, high) in enumerate(zip(np.ravel(box.lower), np.ravel(box.upper), strict=True)):
            if low == high:
                self.opti.subject_to(values[i, :] == low)
            elif np.isfinite([low, high]).any():
                self.opti.subject_to(self.opti.bounded(low, values[i, :], high))


def _rk4(phase: OCP) -> ca.Function:
    """Return (x, u, t, h) -> state and cost after one step with a held control."""
    m, p = phase.model, phase.parameter_values().at(0.0)[0]
    x, u, t, h = ca.SX.sym("x", m.nx), ca.SX.sym("u", m.nu), ca.SX.sym("t"), ca.SX.sym("h")

    def slope(x: ca.SX, t: ca.SX) -> ca.SX:
        f = phase.functions
        return ca.vertcat(f.rate(x, u, t, p), f.running_cost(x, u, t, p))

    k1 = slope(x, t)
    k2 = slope(x + h / 2 * k1[:-1], t + h / 2)
    k3 = slope(x + h / 2 * k2[:-1], t + h / 2)
    k4 = slope(x + h * k3[:-1], t + h)
    change = h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("step", [x, u, t, h], [x + change[:-1], change[-1]])


# -- side by side -----------------------------------------------------------------------


def compared(chain: Phases, intervals: int, runs: int = 5) -> Comparison:
    """Solve a chain here and by hand, in turns, and say what both take."""
    solver = MultipleShooting(intervals, accuracy=np.inf, feasibility_restoration=False)
    guess = tuple(Guess(x=phase.start(), u=np.zeros(phase.model.nu)) for phase in chain.phases)
    started = process_time()
    program = solver.unjudged().build(chain)
    built = process_time() - started
    started = process_time()
    by_hand = ByHand(chain, intervals)
    builds = np.array([built, process_time() - started])
    times, costs = [], (0.0, 0.0)
    for _ in range(runs + 1):
        started = process_time()
        found = program.run(guess=guess).or_raise()
        middle = process_time()
        costs = found.cost, by_hand.run()
        times.append((middle - started, process_time() - middle))
    runs_alone = np.median(times[1:], axis=0)
    # Opti sets up its backend at the first run.
    builds += np.array(times[0]) - runs_alone
    return Comparison(
        chain.name,
        *costs,
        (float(builds[0]), float(builds[1])),
        (float(runs_alone[0]), float(runs_alone[1])),
    )
