"""The memory of the native solver as Python writes and reads it."""

from typing import NamedTuple

import numpy as np


class NativeArrays(NamedTuple):
    """The memory that Python writes and reads, as views; see ``workspace.h``."""

    x: np.ndarray
    u: np.ndarray
    costate: np.ndarray
    data: np.ndarray
    low: np.ndarray
    up: np.ndarray
    v: np.ndarray
    z_low: np.ndarray
    z_up: np.ndarray
    y: np.ndarray
    x_given: np.ndarray
    u_given: np.ndarray
    has_low: np.ndarray
    has_up: np.ndarray
    is_equation: np.ndarray
    gap: np.ndarray
    slope: np.ndarray
    gradient: np.ndarray
    hessian: np.ndarray
    c_slope: np.ndarray
    sigma: np.ndarray
    rhs: np.ndarray
    dx: np.ndarray
    du: np.ndarray
    dcostate: np.ndarray
    sizes: np.ndarray
    plan_t: np.ndarray
    plan_x: np.ndarray
    plan_u: np.ndarray
    plan_costate: np.ndarray
    half_step: np.ndarray
