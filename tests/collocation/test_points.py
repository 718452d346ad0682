"""The points, their matrices, and meshes."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ocp import ProblemError
from solvers import Mesh
from solvers.collocation.collocation_points import CollocationPoints, Family
from solvers.collocation.mesh import CollocationGrid
from tests.tolerances import ROUNDING

every = pytest.mark.parametrize(
    ("family", "degree"), [(f, d) for f in ("radau", "gauss") for d in (2, 3, 4, 5)]
)


@every
def test_quadrature_is_as_exact_as_its_order(family: Family, degree: int) -> None:
    """Exact up to degree 2d - 2 (Radau) and 2d - 1 (Gauss), and not beyond."""
    points = CollocationPoints.of(family, degree)
    order = 2 * degree - (family == "radau")
    for power in range(order + 1):
        error = abs(points.b @ points.c**power - 1.0 / (power + 1))
        assert error <= ROUNDING if power < order else error > 1e-8


@every
def test_stages_integrate_polynomials_up_to_their_degree(family: Family, degree: int) -> None:
    points = CollocationPoints.of(family, degree)
    for power in range(degree):
        exact = points.c ** (power + 1) / (power + 1)
        np.testing.assert_allclose(points.A @ points.c**power, exact, atol=ROUNDING)
    assert points.has_end == (family == "radau")
    if points.has_end:
        np.testing.assert_allclose(points.A[-1], points.b, atol=ROUNDING)


def test_known_tableaus() -> None:
    """Radau IIA of order 3 and Gauss of order 4 [Hairer & Wanner 1996, IV.5]."""
    radau, gauss = CollocationPoints.of("radau", 2), CollocationPoints.of("gauss", 2)
    np.testing.assert_allclose(radau.A, [[5 / 12, -1 / 12], [3 / 4, 1 / 4]], atol=ROUNDING)
    root = np.sqrt(3.0) / 6.0
    np.testing.assert_allclose(gauss.A, [[1 / 4, 1 / 4 - root], [1 / 4 + root, 1 / 4]])


@every
def test_controls_at_the_points_and_their_coefficients(family: Family, degree: int) -> None:
    points = CollocationPoints.of(family, degree)
    np.testing.assert_allclose(points.B.sum(axis=1), 1.0, atol=ROUNDING)
    assert (points.B >= 0.0).all()
    assert np.linalg.cond(points.B) < 200.0


meshes = st.lists(st.tuples(st.floats(0.05, 1.0), st.integers(2, 5)), min_size=1, max_size=7)


@given(meshes, st.sampled_from(["radau", "gauss"]))
@settings(max_examples=40, deadline=None)
def test_grids_know_their_nodes(cells: list[tuple[float, int]], family: Family) -> None:
    widths = np.array([width for width, _ in cells])
    edges = np.append(0.0, np.cumsum(widths) / widths.sum())
    edges[-1] = 1.0
    grid = CollocationGrid.of(Mesh(tuple(edges), tuple(d for _, d in cells)), family)
    np.testing.assert_array_equal(grid.nodes[grid.edge_nodes], edges)
    np.testing.assert_array_equal(grid.nodes[grid.point_nodes], grid.at)
    inside = len(cells) * (family == "gauss")
    assert len(grid.nodes) == 1 + sum(d for _, d in cells) + inside
    assert (np.diff(grid.nodes) > 1e-6).all()
    assert (np.bincount(grid.owner) == grid.mesh.degrees).all()


@pytest.mark.parametrize(
    "make",
    [
        lambda: CollocationPoints.of("lobatto", 3),  # pyright: ignore[reportArgumentType]
        lambda: CollocationPoints.of("radau", 1),
        lambda: CollocationPoints.of("gauss", 6),
        lambda: Mesh((0.0, 1.0), ()),
        lambda: Mesh((0.0, 1.0), (3, 3)),
        lambda: Mesh((0.0, 0.5, 0.5, 1.0), (3, 3, 3)),
        lambda: Mesh((0.1, 1.0), (3,)),
        lambda: Mesh((0.0, 0.9), (3,)),
        lambda: Mesh((0.0, np.nan, 1.0), (3, 3)),
        lambda: Mesh((0.0,), ()),
        lambda: Mesh((0.0, 1.0), (7,)),
        lambda: Mesh.uniform(0, 3),
        lambda: Mesh.uniform(3, 1),
    ],
)
def test_bad_points_and_meshes(make: Callable[[], object]) -> None:
    with pytest.raises(ProblemError):
        make()
