"""Numbers that a user gives, checked once and named in the message."""

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp import ProblemError
from ocp.internal import check_numbers

# What R'R may differ from the unit matrix by: rounded entries are refused, rounding is not.
_ORTHONORMAL = 1e-9
# How far below 0 a moment of inertia may be by rounding, as a share of the largest entry or 1.
_ROUNDING = 1e-12


def vector(values: ArrayLike, size: int, what: str) -> np.ndarray:
    """Return ``values`` as ``ocp.numbers`` does; one number does not stand for all."""
    return check_numbers(values, size, what, repeat=False)


def returned_expression(value: Any, shape: tuple[int, int], what: str) -> ca.SX:
    """Return what a function of a user returned, an expression or numbers, as a dense expression.

    Raises:
        ProblemError: on another shape, and on what is neither.
    """
    try:
        found = ca.SX(ca.vertcat(*value) if isinstance(value, list | tuple) else value)
    except (TypeError, ValueError, NotImplementedError) as error:
        raise ProblemError(f"{what}: it returns a {type(value).__name__}, no casadi.SX") from error
    if found.shape != shape:
        raise ProblemError(f"{what}: it returns shape {found.shape}, {shape} is needed")
    return ca.densify(found)


def checked_matrix(
    values: ArrayLike | ca.DM, shape: tuple[int | None, int], what: str
) -> np.ndarray:
    """Return a read-only matrix of a shape; None: of any number of rows, one at least.

    Raises:
        ProblemError: on another shape, rows of different lengths, what is no number, and NaN.
    """
    try:
        given = np.array(values) if isinstance(values, ca.DM) else np.asarray(values)
    except ValueError as error:
        raise ProblemError(f"{what} has rows of different lengths: {values}") from error
    rows, columns = shape
    fits = given.ndim == 2 and given.shape[1] == columns and given.shape[0] > 0
    if not fits or rows not in (None, given.shape[0]):
        needed = f"({'m' if rows is None else rows}, {columns})"
        empty = " (it is empty)" if given.shape[:1] == (0,) else ""
        raise ProblemError(f"{what} has shape {given.shape}{empty}, {needed} is needed")
    return check_numbers(given, given.size, what, repeat=False).reshape(given.shape)


def checked_rotation(values: ArrayLike | ca.DM, what: str) -> np.ndarray:
    """Return a rotation (3, 3).

    Raises:
        ProblemError: as ``checked_matrix`` does, and on what is no rotation.
    """
    matrix = checked_matrix(values, (3, 3), what)
    away = float(np.abs(matrix.T @ matrix - np.eye(3)).max())
    if away > _ORTHONORMAL:
        raise ProblemError(
            f"{what} is not orthonormal: R'R differs from the unit matrix by {away:.3g}; "
            "normalise its columns"
        )
    if np.linalg.det(matrix) < 0.0:
        raise ProblemError(f"{what} is a reflection (its determinant is -1): turn one column round")
    return matrix


def checked_tensor(values: ArrayLike, what: str) -> np.ndarray:
    """Return moments of inertia (3, 3) about a centre of mass.

    Raises:
        ProblemError: as ``checked_matrix`` does, and on a tensor that is not symmetric or has a
            principal moment below 0.
    """
    tensor = checked_matrix(values, (3, 3), f"{what}: tensor")
    if not np.allclose(tensor, tensor.T):
        raise ProblemError(f"{what}: its tensor is not symmetric: {tensor.tolist()}")
    least = np.linalg.eigvalsh(tensor)[0]
    if least < -_ROUNDING * max(1.0, np.abs(tensor).max()):
        raise ProblemError(
            f"{what}: a principal moment of inertia is {least:.3g} kg m^2, it must be 0 or more"
        )
    return tensor
