"""The gradients that the thesis derives by hand (appendix A.3 to A.18), against CasADi's.

Written with the slips mended as docs/theory.md lists them. With them the hand-made gradient is
the derivative of the Hamiltonian, to rounding: nothing is neglected in it.
"""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models import Disc, DistanceCost, PlanarArm, line, redundancy_ocp
from ocp import OCP
from ocp.minimum_principle.hamiltonian import hamiltonian

LENGTHS = (1.0, 0.8, 0.7, 0.5)
CENTER, RADIUS, INFLUENCE, GAIN, WEIGHT = np.array([0.9, 1.1]), 0.2, 2.5, 3.0, 0.7
VELOCITY = np.array([-0.4, 0.3])


def axes(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors along the links (n, 2), and their derivative by their own angle."""
    phi = np.cumsum(theta)
    return np.stack([np.cos(phi), np.sin(phi)], axis=1), np.stack([-np.sin(phi), np.cos(phi)], 1)


def jacobian(theta: np.ndarray) -> np.ndarray:
    """J (2, n)."""
    lengths = np.array(LENGTHS[: len(theta)])[:, None]
    return np.cumsum((lengths * axes(theta)[1])[::-1], axis=0)[::-1].T


def jacobian_rates(theta: np.ndarray) -> np.ndarray:
    """The derivative of J by each angle, (n, 2, n)."""
    n = len(theta)
    lengths = np.array(LENGTHS[:n])[:, None]
    tails = np.cumsum((-lengths * axes(theta)[0])[::-1], axis=0)[::-1]
    return np.array([[tails[max(i, j)] for j in range(n)] for i in range(n)]).transpose(0, 2, 1)


def distance_gradient(theta: np.ndarray) -> np.ndarray:
    """A.1 to A.3: the derivative of p0 by the angles, for the closest point of the arm."""
    along, across = axes(theta)
    lengths = np.array(LENGTHS[: len(theta)])[:, None]
    joints = np.vstack([np.zeros(2), np.cumsum(lengths * along, axis=0)])
    best = (np.inf, 0, np.zeros(2), 0.0)
    for i in range(len(theta)):
        share = np.clip((CENTER - joints[i]) @ along[i] / lengths[i, 0], 0.0, 1.0)
        point = joints[i] + share * lengths[i, 0] * along[i]
        best = min(
            best, (float(np.linalg.norm(point - CENTER)), i, point, share), key=lambda b: b[0]
        )
    d, link, point, share = best
    # The derivative of the point of the link that is the closest one now.
    moves = np.zeros((2, len(theta)))
    reach = np.where(np.arange(len(theta)) < link, 1.0, share * (np.arange(len(theta)) == link))
    for j in range(link + 1):
        moves[:, j] = (reach[:, None] * lengths * across)[j : link + 1].sum(axis=0)
    scale = INFLUENCE / (INFLUENCE - RADIUS)
    depth = max(0.0, INFLUENCE - INFLUENCE * (d - RADIUS) / (INFLUENCE - RADIUS))
    return -GAIN * scale * depth**2 * (point - CENTER) @ moves / d


def hand_made(theta: np.ndarray, y: np.ndarray, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The derivatives of H by y (A.4) and by theta (A.5 to A.18)."""
    j, rates = jacobian(theta), jacobian_rates(theta)
    gram = np.linalg.inv(j @ j.T)
    sharp = j.T @ gram
    null = np.eye(len(theta)) - sharp @ j
    velocity = sharp @ VELOCITY + null @ y
    s = VELOCITY - j @ y
    a = np.array([s @ gram @ r for r in rates])
    b = np.array([s @ gram @ j @ r.T @ gram @ j for r in rates])
    c = np.array([s @ gram @ r @ j.T @ gram @ j for r in rates])
    d = np.array([y @ r.T @ sharp.T for r in rates])
    transposed = a - b - c - d  # (dg/dtheta)', A.18
    by_theta = 2.0 * transposed @ velocity + transposed @ psi + WEIGHT * distance_gradient(theta)
    return 2.0 * null.T @ velocity + null.T @ psi, by_theta


@cache
def problem(links: int) -> OCP:
    """The raw problem of the thesis; p0 reaches over the whole workspace, so that it counts."""
    arm = PlanarArm(LENGTHS[:links])
    start = np.full(links, 0.4)
    return redundancy_ocp(
        arm,
        line(np.array(arm.end_effector(start)).ravel(), VELOCITY),
        theta0=start,
        horizon=0.1,
        obstacles=(Disc(CENTER, RADIUS),),
        distance_cost=DistanceCost(GAIN, INFLUENCE, "closest"),
        weight=WEIGHT,
        cost="raw",
    )


numbers = st.floats(-3.0, 3.0)


@pytest.mark.parametrize("links", [3, 4])
@given(data=st.data())
def test_the_corrected_appendix_is_the_derivative_of_the_hamiltonian(links, data):
    draw = np.array(data.draw(st.lists(numbers, min_size=3 * links, max_size=3 * links)))
    theta, y, psi = draw.reshape(3, links)
    if np.linalg.svd(jacobian(theta), compute_uv=False)[-1] < 0.1:
        return  # near a singular configuration both are large, and differ in rounding
    by_y, by_theta = hand_made(theta, y, psi)
    h = hamiltonian(problem(links))
    found = (
        np.array(h.control_gradient(theta, y, psi, 0.0, [])).ravel(),
        -np.array(h.costate_rate(theta, y, psi, 0.0, [])).ravel(),
    )
    np.testing.assert_allclose(found[0], by_y, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found[1], by_theta, rtol=1e-8, atol=1e-8)
