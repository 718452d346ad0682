r"""The distance of two features: vertices, edges and faces that are nearest to each other.

Which features of two bodies are nearest is decided by comparisons. They are hidden in a call node
whose outputs are constant wherever they do not jump, so that its derivatives are zero. What is left
is a formula, and by the envelope theorem its derivatives, first and second, are those of the
distance: the nearest points move along their features, and there the distance does not change.

Two points apart by w, one of each feature, and the directions in which the features extend give

.. math::

    d = \frac{n'w}{|n|} \quad (\text{plane}), \qquad
    d = \Bigl| w - \frac{e'w}{e'e}\, e \Bigr| \quad (\text{line or point})

where two directions span a plane with the normal n (a vertex on a face, an edge across an edge),
one is e (a vertex on an edge), or there is none (two vertices).
"""

from typing import NamedTuple

import casadi as ca

# Under the root [m^2]: where two vertices, or a vertex and an edge, touch, the gradient is 0
# instead of NaN. A distance of 1 mm changes by 5e-18 m, one of 0 by 1e-10 m.
_ROOT = 1e-20
# Added to squared lengths [m^2] that may be zero: 0 / 0 is then 0.
TINY = 1e-30
# Edges whose directions differ by less than the root of this are parallel [rad^2].
PARALLEL = 1e-12


class Gap(NamedTuple):
    """The nearest features of two bodies.

    Attributes:
        w: from a point of the first to a point of the second (3,) [m].
        line: e (3,), zero without a direction.
        normal: n (3,), from the first to the second; zero without a plane.
        has_plane: 1 with a plane, else 0.
    """

    w: ca.SX
    line: ca.SX
    normal: ca.SX
    has_plane: ca.SX

    @property
    def distance(self) -> ca.SX:
        """The distance d [m]; of a plane with a sign."""
        across = self._height / ca.sqrt(self._normal_squared)
        beside = ca.sqrt(ca.sumsqr(self._beside) + _ROOT)
        return beside + self.has_plane * (across - beside)

    @property
    def squared(self) -> ca.SX:
        """Its square [m^2], without a root."""
        across, beside = self._height**2 / self._normal_squared, ca.sumsqr(self._beside)
        return beside + self.has_plane * (across - beside)

    @property
    def _height(self) -> ca.SX:
        return ca.dot(self.normal, self.w)

    @property
    def _normal_squared(self) -> ca.SX:
        return ca.sumsqr(self.normal) + (1.0 - self.has_plane)

    @property
    def _beside(self) -> ca.SX:
        along = ca.dot(self.line, self.w) / (ca.sumsqr(self.line) + TINY)
        return self.w - along * self.line


def clamped(value: ca.SX) -> ca.SX:
    """Return a value cut to [0, 1]."""
    return ca.fmax(0.0, ca.fmin(1.0, value))
