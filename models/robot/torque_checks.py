"""Can this robot stand where a motion begins and ends, and push at all? Asked in numbers."""

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models.robot.robot import Robot
from ocp import Parameter, ProblemError, Signal
from ocp.internal import check_instance, check_numbers, check_positive


def check_parameters(robot: Robot, parameters: Sequence[Parameter | Signal], name: str) -> None:
    """Refuse what has no value at run time."""
    check_instance(parameters, (tuple, list), f"{name}: parameters")
    for entry in parameters:
        check_instance(entry, (Parameter, Signal), f"{name}: an entry of parameters")
    known = {s.element_hash() for entry in parameters for s in ca.vertsplit(entry.symbol)}
    unknown = [] if robot.payload is None else ca.vertsplit(robot.payload.symbols)
    for symbol in unknown:
        if symbol.element_hash() not in known:
            raise ProblemError(
                f"{name}: parameters: in the robot, '{symbol}' is a symbol without a value: give "
                f"parameters=[Parameter('{symbol}', {symbol}, value)]"
            )


def checked_configuration(robot: Robot, given: ArrayLike, what: str) -> np.ndarray:
    """Return a configuration (n,) that is within the limits of the joints."""
    q, limits = check_numbers(given, robot.n, what, repeat=False), robot.limits
    for i in np.flatnonzero((q < limits.lower) | (q > limits.upper)):
        raise ProblemError(
            f"{what}: joint '{robot.joints[i]}' is at {q[i]:g}, outside its limits "
            f"{limits.lower[i]:g} to {limits.upper[i]:g} {robot.units[i]}"
        )
    return q


def usable_limit(robot: Robot, limits: np.ndarray, share: float, what: str) -> np.ndarray:
    """Return the part of the limits that may be used, (n,)."""
    part = check_positive(share, f"{what}_share")
    if part > 1.0:
        raise ProblemError(f"{what}_share = {part}, it must be at most 1")
    for i in np.flatnonzero(limits == 0.0):
        raise ProblemError(
            f"{what}: the limit of joint '{robot.joints[i]}' is 0: some descriptions mean by it "
            "that it is not known; write what it is, or leave it out"
        )
    return part * limits


def check_time(
    robot: Robot, way: np.ndarray, velocity: np.ndarray, horizon: float, name: str
) -> None:
    """Refuse a way (n,) that takes longer than the horizon even at the limit of velocity (n,)."""
    needed = np.abs(way) / velocity
    i = int(needed.argmax())
    if needed[i] >= horizon:
        unit = robot.units[i]
        raise ProblemError(
            f"{name}: horizon = {horizon:g} s is too short: joint '{robot.joints[i]}' has "
            f"{abs(way[i]):.4g} {unit} to go, which takes {needed[i]:.4g} s at {velocity[i]:g} "
            f"{unit}/s"
        )
