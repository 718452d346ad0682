"""Angles: states in which the problem has the period of a full turn, found by evaluation."""

from dataclasses import dataclass

import numpy as np

from ocp import OCP, minimum_principle

_TURN = 2.0 * np.pi
_PROBES = 5
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Periods:
    """The period of every state; infinite where it has none.

    Attributes:
        of_states: (nx,).
    """

    of_states: np.ndarray

    @classmethod
    def of(cls, ocp: OCP) -> "Periods":
        """Find the states in rad that a turn of 2 pi leaves the same, at a few probes.

        What has to be the same: canonical flow, running cost, gradient of the terminal cost,
        and invariants. (The bounds of a periodic state would have to be inactive: the methods
        that ask refuse bounds.)
        """
        m, rng = ocp.model, np.random.default_rng(0)
        flow, p = minimum_principle(ocp).flow, ocp.parameter_values().at(0.0)[0]
        f = ocp.functions

        def everything(x: np.ndarray, costate: np.ndarray, t: float) -> np.ndarray:
            u = ocp.control_bounds.clip(np.zeros(m.nu))
            parts = [flow(np.append(x, costate), t, p), f.running_cost(x, u, t, p)]
            parts += [f.terminal_gradient(x, t, p), f.invariants(x, t, p), f.initial(x, t, p)]
            return np.concatenate([np.array(part).ravel() for part in parts])

        periods = np.full(m.nx, np.inf)
        for i in (i for i, unit in enumerate(m.x_units) if unit == "rad"):
            probes = [
                (ocp.start() + rng.normal(size=m.nx), rng.normal(size=m.nx), share * ocp.duration)
                for share in rng.uniform(size=_PROBES)
            ]
            turn = _TURN * np.eye(m.nx)[i]
            changes = [everything(x + turn, c, t) - everything(x, c, t) for x, c, t in probes]
            scales = [1.0 + np.abs(everything(*probe)).max() for probe in probes]
            if all(np.abs(d).max() <= _SAME * s for d, s in zip(changes, scales, strict=True)):
                periods[i] = _TURN
        return cls(periods)

    def turns(self, difference: np.ndarray) -> np.ndarray:
        """Return the whole turns in a difference of states, in the states' units."""
        finite = np.isfinite(self.of_states)
        period = np.where(finite, self.of_states, 1.0)
        return np.where(finite, period * np.round(difference / period), 0.0)

    def wrapped(self, difference: np.ndarray) -> np.ndarray:
        """Return a difference of states without whole turns."""
        return difference - self.turns(difference)
