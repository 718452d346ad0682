"""The mesh of a collocated trajectory: the edges of its intervals, and their degrees."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ocp import Grid, ProblemError
from ocp.internal import check_instance, check_real
from solvers.collocation.collocation_points import CollocationPoints, Family


@dataclass(frozen=True)
class Mesh:
    """A ``Grid`` whose intervals have each a degree of its own.

    Args:
        edges: fractions of the horizon, from 0 to 1, (K + 1,).
        degrees: 2 to 5 for each interval, (K,).

    Raises:
        ProblemError: if the edges do not increase from 0 to 1 or a degree is missing or outside.
    """

    edges: tuple[float, ...]
    degrees: tuple[int, ...]

    def __post_init__(self) -> None:
        """Check both, and keep them as tuples."""
        check_instance(self.edges, (tuple, list, np.ndarray), "mesh: edges")
        check_instance(self.degrees, (tuple, list, np.ndarray), "mesh: degrees")
        edges = Grid(tuple(check_real(edge, "mesh: edge") for edge in self.edges)).fractions
        degrees = tuple(self.degrees)
        if len(degrees) != len(edges) - 1:
            raise ProblemError(f"mesh: {len(degrees)} degrees for {len(edges) - 1} intervals")
        for degree in degrees:
            CollocationPoints.of("radau", degree)
        object.__setattr__(self, "edges", edges)
        object.__setattr__(self, "degrees", degrees)

    @classmethod
    def uniform(cls, intervals: int, degree: int) -> "Mesh":
        """Return equal intervals of one degree."""
        return cls(Grid.uniform(intervals).fractions, (degree,) * intervals)

    @property
    def intervals(self) -> int:
        """Number of intervals K."""
        return len(self.degrees)

    @property
    def widths(self) -> np.ndarray:
        """Lengths as fractions of the horizon, (K,)."""
        return np.diff(self.edges)

    def cut(self, parts: int, which: np.ndarray | None = None) -> "Mesh":
        """Return the mesh with intervals cut into equal parts, (K,) of bool says which."""
        chosen = np.ones(self.intervals, dtype=bool) if which is None else which
        edges, degrees = [0.0], []
        for right, degree, cut in zip(self.edges[1:], self.degrees, chosen, strict=True):
            count = parts if cut else 1
            edges += np.linspace(edges[-1], right, count + 1)[1:].tolist()
            degrees += [degree] * count
        return Mesh(tuple(edges), tuple(degrees))


@dataclass(frozen=True, eq=False)
class CollocationGrid:
    """A mesh with its collocation points: M of them, on all intervals.

    Attributes:
        mesh: the intervals.
        points: the points of each interval.
    """

    mesh: Mesh
    points: tuple[CollocationPoints, ...]

    @classmethod
    def of(cls, mesh: Mesh, family: Family) -> "CollocationGrid":
        """Put the points of a family on a mesh."""
        return cls(mesh, tuple(CollocationPoints.of(family, degree) for degree in mesh.degrees))

    @cached_property
    def owner(self) -> np.ndarray:
        """The interval of each point, (M,)."""
        return np.repeat(np.arange(self.mesh.intervals), self.mesh.degrees)

    @cached_property
    def at(self) -> np.ndarray:
        """Points as fractions of the horizon, (M,)."""
        edges = np.asarray(self.mesh.edges)
        inside = np.concatenate([p.c for p in self.points])
        # The last point of Radau is the edge itself, not almost.
        exact = edges[self.owner] + inside * self.mesh.widths[self.owner]
        return np.where(inside == 1.0, edges[self.owner + 1], exact)

    @cached_property
    def nodes(self) -> np.ndarray:
        """Edges and points together, as fractions of the horizon, (N + 1,)."""
        return np.unique(np.concatenate([self.mesh.edges, self.at]))

    @cached_property
    def edge_nodes(self) -> np.ndarray:
        """Which nodes the edges are, (K + 1,)."""
        return np.searchsorted(self.nodes, self.mesh.edges)

    @cached_property
    def point_nodes(self) -> np.ndarray:
        """Which nodes the points are, (M,)."""
        return np.searchsorted(self.nodes, self.at)
