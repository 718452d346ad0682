"""Which controls stand at a bound: found by exchanging those that do not belong."""

from dataclasses import dataclass, field

import numpy as np

from ocp import Box

# Violations and slopes below this, relative to what they are made of, are rounding.
_ROUNDING = 1e-12
# How often all wrong controls may be exchanged at once without their number falling.
_PATIENCE = 3
# Most exchanges.
_LIMIT = 60


@dataclass(eq=False)
class Clamped:
    r"""The active set of a quadratic program whose only inequalities are lower <= u + du <= upper.

    With some controls clamped at their bounds the others follow from one recursion. The choice
    is right if no free control leaves its bounds, and the slope g of the cost in a clamped one
    has the sign of a multiplier: g >= 0 at a lower bound, g <= 0 at an upper one. Otherwise those
    that are wrong change: the free ones are clamped at the bound they violate, the clamped ones are freed.
    Done for all at once this is Newton's method [Hintermueller, Ito & Kunisch 2002], right after
    one or two recursions from a good guess. From a bad one it may cycle: where the number of wrong
    controls has not fallen for three times, only the last wrong one is exchanged until it falls, which ends after
    finitely many where the program is strictly convex [Judice & Pires 1994].

    Attributes:
        room: from the controls to their lower and to their upper bounds, (nu, N) each.
        side: -1: at its lower bound, 1: at its upper one, 0: free (nu, N).
        scale: of the slopes, 1 + largest abs(p).
    """

    room: tuple[np.ndarray, np.ndarray]
    side: np.ndarray
    scale: float
    _wrong: np.ndarray = field(init=False)
    _next: np.ndarray = field(init=False)
    _fewest: float = field(default=np.inf, init=False)
    _patience: int = field(default=_PATIENCE, init=False)
    _left: int = field(default=_LIMIT, init=False)

    @classmethod
    def at(cls, u: np.ndarray, pull: np.ndarray, bounds: Box, scale: float) -> "Clamped":
        """Begin with those at a bound that the slope ``pull`` of the cost holds there."""
        below, above = (np.asarray(b)[:, None] - u for b in (bounds.lower, bounds.upper))
        low, high = (pull > 0.0) & (below >= -pull), (pull < 0.0) & (above <= -pull)
        side = high.astype(int) - low
        side[below == above] = -1
        return cls((below, above), side, scale)

    @property
    def chosen(self) -> np.ndarray:
        """1 for a clamped control, 0 for a free one (nu, N)."""
        return np.abs(self.side)

    @property
    def moves(self) -> np.ndarray:
        """How far the clamped controls are from their bounds, 0 for the free ones (nu, N)."""
        below, above = self.room
        return np.where(self.side < 0, below, np.where(self.side > 0, above, 0.0))

    def suits(self, du: np.ndarray, pull: np.ndarray) -> bool:
        """Return whether the choice is right, for the step and the slopes it has led to."""
        (below, above), side = self.room, self.side
        slack, flat = _ROUNDING * (1.0 + np.abs(du)), _ROUNDING * self.scale
        low = (side == 0) & (du < below - slack)
        high = (side == 0) & (du > above + slack)
        freed = (side * pull > flat) & (below < above)
        self._wrong = low | high | freed
        self._next = high.astype(int) - low
        return not self._wrong.any()

    def exchange(self) -> bool:
        """Change the choice; False: it was changed too often."""
        count = int(self._wrong.sum())
        if self._left == 0:
            return False
        self._left -= 1
        if count < self._fewest:
            self._fewest, self._patience = count, _PATIENCE
        else:
            self._patience -= 1
        wrong = self._wrong
        if self._patience < 0:
            # In the order of time the last one, within a stage the last component.
            stage, component = np.argwhere(wrong.T)[-1]
            wrong = np.zeros_like(wrong)
            wrong[component, stage] = True
        self.side = np.where(wrong, self._next, self.side)
        return True
