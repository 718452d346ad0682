"""Which controls stand at a bound: found by exchanging those that do not belong."""

from dataclasses import dataclass, field

import numpy as np

from ocp import Box

# Violations and slopes below this, relative to what they are made of, are rounding.
_ROUNDING = 1e-12
# Most exchanges: a good guess takes one or two, and without end none is worth while.
_LIMIT = 15


@dataclass(eq=False)
class Clamped:
    r"""The active set of a quadratic program whose only inequalities are bounds of controls.

    With some controls clamped at their bounds the others follow from one recursion. The choice
    is right if no free control leaves its bounds, and the slope g of the cost in each clamped one
    has the sign of its multiplier: g >= 0 at a lower bound, g <= 0 at an upper one. Those that
    are wrong are exchanged: free ones are clamped at the bound that they leave, clamped ones
    freed. All at once this is Newton's method, done after one or two recursions from a good
    guess [Hintermueller, Ito & Kunisch 2002]. From a bad one it may cycle; where the number of
    wrong ones does not fall, only the last of them is exchanged until it does, which ends after
    finitely many recursions where the program is strictly convex [Judice & Pires 1994]. That
    may be many: to wait for it is not worth while, since with a shift of the second derivative
    it takes few.

    Attributes:
        room: from the controls to their lower and to their upper bounds, (nu, N) each.
        side: -1: at the lower bound, 1: at the upper one, 0: free, (nu, N).
    """

    room: tuple[np.ndarray, np.ndarray]
    side: np.ndarray
    _wrong: np.ndarray = field(init=False)
    _next: np.ndarray = field(init=False)
    _fewest: float = field(default=np.inf, init=False)
    _left: int = field(default=_LIMIT, init=False)

    @classmethod
    def at(cls, u: np.ndarray, pull: np.ndarray, bounds: Box) -> "Clamped":
        """Begin with those that a step along the slopes ``pull`` of the cost takes to a bound."""
        below, above = (np.asarray(bound)[:, None] - u for bound in (bounds.lower, bounds.upper))
        low, high = (pull > 0.0) & (-pull <= below), (pull < 0.0) & (-pull >= above)
        side = high.astype(int) - low
        side[below == above] = -1
        return cls((below, above), side)

    @property
    def chosen(self) -> np.ndarray:
        """1 for a clamped control, 0 for a free one (nu, N)."""
        return np.abs(self.side)

    @property
    def moves(self) -> np.ndarray:
        """How far the clamped controls are from their bounds, 0 for the free ones (nu, N)."""
        below, above = self.room
        return np.where(self.side < 0, below, np.where(self.side > 0, above, 0.0))

    def suits(self, du: np.ndarray, slope: np.ndarray, scale: float) -> bool:
        """Return whether the choice is right, by the step and the slopes g that it has led to.

        Args:
            du: the step (nu, N).
            slope: g (nu, N), 0 for the free controls.
            scale: of what slopes are made of.
        """
        (below, above), free = self.room, self.side == 0
        slack, flat = _ROUNDING * (1.0 + np.abs(du)), _ROUNDING * scale
        low, high = free & (du < below - slack), free & (du > above + slack)
        self._wrong = low | high | ((self.side * slope > flat) & (below < above))
        self._next = high.astype(int) - low
        return not self._wrong.any()

    def exchange(self) -> bool:
        """Change the choice; False: it was changed too often."""
        self._left -= 1
        wrong, count = self._wrong, int(self._wrong.sum())
        if count < self._fewest:
            self._fewest = count
        else:
            stages, components = np.nonzero(wrong.T)
            wrong = np.zeros_like(wrong)
            wrong[components[-1], stages[-1]] = True
        self.side = np.where(wrong, self._next, self.side)
        return self._left >= 0
