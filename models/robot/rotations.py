"""Rotation matrices as numbers, with exact zeros and ones where an angle means a quarter turn."""

import numpy as np

_QUARTER_SINES = (0.0, 1.0, 0.0, -1.0)


def sine_and_cosine(angle: float, tidy: float) -> tuple[float, float]:
    """Return both; exactly 0 or 1 where the angle is within ``tidy`` [rad] of quarter turns.

    Descriptions write pi/2 with few digits. Zeros in a rotation save a quarter of the operations
    of the robot's equations; what is moved is the robot, by ``tidy`` at most.
    """
    quarters = round(angle / (np.pi / 2.0))
    if abs(angle - quarters * np.pi / 2.0) <= tidy:
        return _QUARTER_SINES[quarters % 4], _QUARTER_SINES[(quarters + 1) % 4]
    return float(np.sin(angle)), float(np.cos(angle))


def roll_pitch_yaw(angles: np.ndarray, tidy: float) -> np.ndarray:
    """Return Rz(yaw) Ry(pitch) Rx(roll) (3, 3) of angles (roll, pitch, yaw) [rad]."""
    (sr, cr), (sp, cp), (sy, cy) = (sine_and_cosine(float(a), tidy) for a in angles)
    roll = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    pitch = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    yaw = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    return yaw @ pitch @ roll


def onto_z(axis: np.ndarray) -> np.ndarray:
    """Return a rotation (3, 3) whose third column is ``axis``; a permutation if it can be."""
    i = int(np.argmax(np.abs(axis)))
    first = np.roll(np.eye(3)[i], 1)
    first = first - axis * (first @ axis)
    first = first / np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
