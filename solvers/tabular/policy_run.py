"""The trajectory along the minimising controls of a table."""

from dataclasses import dataclass

import numpy as np

from ocp.internal import RunData
from solvers.tabular.bellman import Bellman, ValueFunction


@dataclass(frozen=True, eq=False)
class PolicyRun:
    """A trajectory along the minimising controls.

    Attributes:
        x: states (N + 1, nx).
        u: controls (N, nu).
        cost: its cost, inf where it ends early.
        expected: cost-to-go from the start, of the grid.
        failed: step at which no control was feasible, or None.
    """

    x: np.ndarray
    u: np.ndarray
    cost: float
    expected: float
    failed: int | None = None


def follow_policy(bellman: Bellman, table: ValueFunction, data: RunData) -> PolicyRun:
    """Simulate with the control that is best for the state itself, not for its neighbours."""
    _, common = bellman.schedule(data)
    x, u, cost, expected = [data.x0], [], 0.0, np.inf
    for k, now in enumerate(common):
        control, total = _best(bellman, table, x[-1], now, k)
        if not np.isfinite(total):
            return _stopped(bellman, data, x, u, k)
        expected = total if k == 0 else expected
        after, paid = bellman.step(x[-1][None], control[None], now, first=k == 0)
        x.append(after[0])
        u.append(control)
        cost += float(paid[0])
    t, p = table.t[-1], data.values.at(1.0)[0]
    cost += float(bellman.ocp.functions.terminal_cost(x[-1], t, p))
    return PolicyRun(np.array(x), np.array(u), cost, expected)


def _best(
    bellman: Bellman, table: ValueFunction, x: np.ndarray, now: list[np.ndarray], k: int
) -> tuple[np.ndarray, float]:
    """Return the best control off the grid of controls, and the cost from here on."""

    def total(u: np.ndarray) -> np.ndarray:
        after, cost = bellman.step(np.tile(x, (len(u), 1)), u, now, first=k == 0)
        return table.cost_to_go(k + 1, after) + cost

    tried = total(bellman.controls.points)
    value, control = bellman.minimum(tried[None, :])
    if np.isfinite(total(control)[0]):
        return control[0], float(value[0])
    best = int(tried.argmin())
    return bellman.controls.points[best], float(tried[best])


def _stopped(
    bellman: Bellman, data: RunData, x: list[np.ndarray], u: list[np.ndarray], k: int
) -> PolicyRun:
    """A trajectory that stays where no control was feasible; its cost is inf."""
    rest = bellman.n - k
    still = bellman.ocp.control_bounds.clip(np.zeros(bellman.ocp.model.nu))
    states = np.vstack([*x, *[x[-1]] * rest])
    return PolicyRun(states, np.vstack([*u, *[still] * rest]), np.inf, np.inf, k)
