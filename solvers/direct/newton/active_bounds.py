"""The active set of a Newton step: which controls are clamped at a bound, found by exchanges."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ocp import Box

# Violations and gradients below this, relative to the measure of each, are rounding errors.
_ROUNDING = 1e-12


class BoundsCheck(NamedTuple):
    """Which controls are on the wrong side of the choice between clamped and free.

    Attributes:
        wrong: bool (nu, N).
        outside: by how much the step leaves the bounds, with its sign (nu, N).
    """

    wrong: np.ndarray
    outside: np.ndarray


@dataclass(frozen=True, eq=False)
class ActiveBounds:
    r"""The active set of a quadratic program whose only inequalities are bounds of controls.

    With some controls clamped at their bounds the others follow from one Riccati solve. The choice
    is right if no free control leaves its bounds, and the gradient g of the cost in each clamped
    one has the sign of its multiplier: g >= 0 at a lower bound, g <= 0 at an upper one. The wrong
    ones are exchanged: free ones are clamped at the bound that they leave, clamped ones freed.
    All at once this is a semismooth Newton method, done after one or two solves from a good
    guess [Hintermueller, Ito & Kunisch 2002]. From a bad one it may cycle; where the number of
    wrong ones does not fall, only the last of them is exchanged until it does, which ends after
    finitely many solves where the program is strictly convex [Judice & Pires 1994]. These may
    be many, and fewer with a shift of the second derivative: the caller limits their number.

    Attributes:
        below: from the controls to their lower bounds, (nu, N).
        above: to their upper ones.
        unit: of the controls, see ``control_units``, (nu, 1).
        side: -1: at the lower bound, 1: at the upper one, 0: free, (nu, N).
        fewest: smallest number of wrong controls among the earlier choices.
    """

    below: np.ndarray
    above: np.ndarray
    unit: np.ndarray
    side: np.ndarray
    fewest: float = np.inf

    @classmethod
    def at(cls, u: np.ndarray, control_gradient: np.ndarray, bounds: Box) -> "ActiveBounds":
        """Clamp the controls that a step against the gradient of the cost takes out of bounds."""
        unit = control_units(bounds)[:, None]
        below, above = np.asarray(bounds.lower)[:, None] - u, np.asarray(bounds.upper)[:, None] - u
        step = -(unit**2) * control_gradient
        return cls(below, above, unit, (above < step).astype(float) - (step < below))

    @property
    def clamped(self) -> np.ndarray:
        """1 for a clamped control, 0 for a free one (nu, N)."""
        return np.abs(self.side)

    @property
    def clamped_step(self) -> np.ndarray:
        """From the clamped controls to their bounds, 0 for the free ones (nu, N)."""
        return np.where(self.side < 0, self.below, np.where(self.side > 0, self.above, 0.0))

    def check(self, du: np.ndarray, clamped_gradient: np.ndarray, scale: float) -> BoundsCheck:
        """Return which controls are wrong, by the step that the choice has led to.

        Steps and gradients have different units, so each has a tolerance of its own: a free
        control may leave its bounds by a rounding error of their width, or of 1 + abs(du) where
        they are not both finite. At a clamped one e g, with its unit e (see ``control_units``),
        may have the wrong sign by a rounding error of the scale; a control with equal bounds
        stays clamped.

        Args:
            du: the step (nu, N).
            clamped_gradient: g (nu, N).
            scale: of the terms that the gradients are sums of.
        """
        width = self.above - self.below
        reach = np.where(np.isfinite(width), width, 1.0 + np.abs(du))
        outside = du - np.clip(du, self.below, self.above)
        leaves = np.abs(outside) > _ROUNDING * reach
        wrong_sign = self.side * clamped_gradient * self.unit > _ROUNDING * scale
        wrong = np.where(self.side == 0.0, leaves, wrong_sign & (width > 0.0))
        return BoundsCheck(wrong, outside)

    def exchanged(self, check: BoundsCheck) -> "ActiveBounds":
        """Return the next choice."""
        wrong, count = check.wrong, int(check.wrong.sum())
        if count >= self.fewest:
            stages, components = np.nonzero(wrong.T)
            wrong = np.zeros_like(wrong)
            wrong[components[-1], stages[-1]] = True
        other = np.where(self.side == 0.0, np.sign(check.outside), 0.0)
        side = np.where(wrong, other, self.side)
        return ActiveBounds(self.below, self.above, self.unit, side, min(count, self.fewest))


def control_units(bounds: Box) -> np.ndarray:
    """Return the unit e of each control (nu,): the width of its bounds, but at most 1.

    A gradient times e is what a control can make of it. Wide bounds often stand for none, so
    that their width says nothing; a control with equal bounds has the unit 1.
    """
    width = np.asarray(bounds.upper) - np.asarray(bounds.lower)
    return np.where(width > 0.0, np.minimum(width, 1.0), 1.0)
