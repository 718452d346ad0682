"""Which controls stand at a bound: found by exchanging those that do not belong."""

from dataclasses import dataclass, field

import numpy as np

from ocp import Box
from solvers.direct.newton.riccati_recursion import units

# Violations and slopes below this, relative to what is given for each, are rounding.
_ROUNDING = 1e-12
# Most exchanges: a good guess takes one or two, and without end none is worth while.
_LIMIT = 15


@dataclass(eq=False)
class ActiveBounds:
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
        below: from the controls to their lower bounds, (nu, N).
        above: to their upper ones.
        unit: of the controls, (nu, 1).
        side: -1: at the lower bound, 1: at the upper one, 0: free, (nu, N).
    """

    below: np.ndarray
    above: np.ndarray
    unit: np.ndarray
    side: np.ndarray
    _wrong: np.ndarray = field(init=False)
    _out: np.ndarray = field(init=False)
    _fewest: float = field(default=np.inf, init=False)
    _left: int = field(default=_LIMIT, init=False)

    @classmethod
    def at(cls, u: np.ndarray, pull: np.ndarray, bounds: Box) -> "ActiveBounds":
        """Begin with those that a step against the slopes ``pull`` of the cost takes out."""
        unit = units(bounds)[:, None]
        below, above = np.asarray(bounds.lower)[:, None] - u, np.asarray(bounds.upper)[:, None] - u
        step = -(unit**2) * pull
        return cls(below, above, unit, (above < step).astype(float) - (step < below))

    @property
    def chosen(self) -> np.ndarray:
        """1 for a clamped control, 0 for a free one (nu, N)."""
        return np.abs(self.side)

    @property
    def moves(self) -> np.ndarray:
        """How far the clamped controls are from their bounds, 0 for the free ones (nu, N)."""
        return np.where(self.side < 0, self.below, np.where(self.side > 0, self.above, 0.0))

    def suits(self, du: np.ndarray, slope: np.ndarray, scale: float) -> bool:
        """Return whether the choice is right, by the step and the slopes g that it has led to.

        Steps and slopes have different units, so each has a measure of its own: a free control
        may leave its bounds by a rounding error of their width, or of 1 + abs(du) where they are
        not both finite. A clamped one may have the wrong sign of e g, with its unit e (see
        ``units``), by one of the scale; it stays where its bounds are equal.

        Args:
            du: the step (nu, N).
            slope: g (nu, N).
            scale: of what the slopes are made of.
        """
        width, free = self.above - self.below, self.side == 0.0
        reach = np.where(np.isfinite(width), width, 1.0 + np.abs(du))
        self._out = du - np.clip(du, self.below, self.above)
        leaves = np.abs(self._out) > _ROUNDING * reach
        pulled = (self.side * slope * self.unit > _ROUNDING * scale) & (width > 0.0)
        self._wrong = np.where(free, leaves, pulled)
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
        other = np.where(self.side == 0.0, np.sign(self._out), 0.0)
        self.side = np.where(wrong, other, self.side)
        return self._left >= 0
