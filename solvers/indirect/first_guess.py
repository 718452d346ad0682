"""The first iterate of Newton's method, from the parts that a guess has."""

import numpy as np

from ocp import InitialGuess
from ocp.internal import RunData
from solvers.indirect.boundary_value_problem import ExtremalProblem
from solvers.indirect.shooting_segments import ShootingSchedule


def first_unknowns(
    extremals: ExtremalProblem,
    data: RunData,
    schedule: ShootingSchedule,
    guess: InitialGuess | None,
) -> np.ndarray:
    """Return the unknowns of the boundary value problem, see ``UnknownsLayout``.

    Without states in the guess they are constant at the start, without costates those are zero.
    """
    shape, ocp = extremals.shape, extremals.ocp
    nodes = schedule.fractions[:: (len(schedule.fractions) - 1) // shape.segments]
    x = guess.sample("x", nodes, shape.nx) if guess else None
    costate = guess.sample("costate", nodes, shape.nx) if guess else None
    duration = (guess.duration if guess else None) or ocp.duration
    x = np.tile(data.x0, (len(nodes), 1)) if x is None else x
    x = np.vstack([ocp.start_of(data.x0, x[0]), x[1:]])
    z = np.hstack([x, np.zeros_like(x) if costate is None else costate])
    mu, nu = _balancing(extremals, z, schedule, duration)
    return shape.join(z[:-1], mu, nu, duration)


def _balancing(
    extremals: ExtremalProblem, z: np.ndarray, schedule: ShootingSchedule, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the multipliers that best balance the costates of z at both ends."""
    shape, nx = extremals.shape, extremals.shape.nx
    mu, nu, t1 = np.zeros(shape.n_mu), np.zeros(shape.n_nu), schedule.t0 + duration
    value, _, in_mu = extremals.starts(z[0], mu, schedule.t0, schedule.p_first, z[0, :nx])
    mu = -np.linalg.lstsq(in_mu[-nx:], value[-nx:].ravel(), rcond=None)[0]
    value, _, in_nu, _ = extremals.ends(z[-1], nu, t1, schedule.p_last)
    nu = -np.linalg.lstsq(in_nu[:nx], value[:nx].ravel(), rcond=None)[0]
    return mu, nu
