"""The implicit minimiser of the Hamiltonian, from wherever the costates put it."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ocp import OCP, Box, Model, Solution, Status, costates_along, evaluate, minimum_principle
from ocp.minimum_principle.hamiltonian import hamiltonian
from tests.ocp.differences import jacobian
from tests.tolerances import DERIVATIVE, RESIDUAL

# Multiplied by costates, a unit vector has its lowest product opposite to them.
COSTATES = st.tuples(*[st.floats(-3.0, 3.0, allow_subnormal=False)] * 3).filter(
    lambda row: np.hypot(row[0], row[1]) > 1e-3
)


def heading(bounds: Box | None = None) -> OCP:
    """A point that moves by one in the direction of its control, an angle."""
    x, angle = ca.SX.sym("x", 2), ca.SX.sym("angle")
    model = Model(name="point", x=x, u=angle, f=ca.vertcat(ca.cos(angle), ca.sin(angle)))
    return OCP(
        name="heading",
        model=model,
        x0=[0.0, 0.0],
        horizon=1.0,
        terminal_cost=ca.sumsqr(x - ca.DM([1.0, 0.5])),
        control_bounds=bounds or Box(),
    )


def direction() -> OCP:
    """The same in space, with two angles and a price on the second."""
    x, u = ca.SX.sym("x", 3), ca.SX.sym("u", 2)
    f = ca.vertcat(ca.cos(u[0]) * ca.cos(u[1]), ca.sin(u[0]) * ca.cos(u[1]), ca.sin(u[1]))
    model = Model(name="point in space", x=x, u=u, f=f)
    return OCP(name="direction", model=model, x0=[0, 0, 0], horizon=1.0, running_cost=u[1] ** 2)


HEADING, DIRECTION = heading(), direction()


@settings(deadline=None, max_examples=200)
@given(COSTATES)
@example((0.5, 0.0, 0.0))  # no control at all is the maximum of H
@example((0.5002682, -0.33186, 0.0))  # next to an inflection of H, where Newton's step is huge
def test_an_angle_is_that_of_the_minimum(costates: tuple[float, ...]) -> None:
    costate = np.array(costates[:2])
    angle = float(minimum_principle(HEADING).control(np.zeros(2), costate, 0.0, []))
    assert np.cos(angle) == pytest.approx(-costate[0] / np.hypot(*costate), abs=1e-9)
    assert np.sin(angle) == pytest.approx(-costate[1] / np.hypot(*costate), abs=1e-9)


@settings(deadline=None, max_examples=100)
@given(COSTATES)
@example((1.0, 0.0, 8.795651310845108e-147))  # H_uu has entries whose squares underflow
def test_two_angles_minimise_locally(costates: tuple[float, ...]) -> None:
    h, x, costate = hamiltonian(DIRECTION), np.zeros(3), np.array(costates)
    u = np.array(minimum_principle(DIRECTION).control(x, costate, 0.0, [])).ravel()
    assert np.abs(np.array(h.control_gradient(x, u, costate, 0.0, []))).max() < RESIDUAL
    assert np.linalg.eigvalsh(np.array(h.control_curvature(x, u, costate, 0.0, [])))[0] > -1e-9


@settings(deadline=None, max_examples=100)
@given(COSTATES)
def test_a_bounded_angle_meets_the_conditions_of_a_minimum(costates: tuple[float, ...]) -> None:
    box, x, costate = Box(-0.5, 1.5), np.zeros(2), np.array(costates[:2])
    ocp = BOUNDED
    u = np.array(minimum_principle(ocp).control(x, costate, 0.0, [])).ravel()
    slope = np.array(hamiltonian(ocp).control_gradient(x, u, costate, 0.0, [])).ravel()
    assert np.abs(u - box.sized(1, "box").clip(u - slope)).max() < RESIDUAL


BOUNDED = heading(Box(-0.5, 1.5))


def test_the_law_is_differentiated_through_its_root() -> None:
    law, x, costate = minimum_principle(HEADING).control, np.zeros(2), np.array([0.5, -1.2])
    slope = np.array(law.jacobian()(x, costate, 0.0, [], law(x, costate, 0.0, []))[1], dtype=float)
    differences = jacobian(lambda c: np.array(law(x, c, 0.0, [])).ravel(), costate)
    assert slope == pytest.approx(differences, abs=DERIVATIVE)


@pytest.mark.many
@pytest.mark.parametrize("costate", [np.zeros(2), np.array([1e-9, 0.0]), np.array([1e12, -1e12])])
def test_where_there_is_no_minimum_the_referee_says_so(costate: np.ndarray) -> None:
    """Without costates H is flat and its Jacobian singular: a bad verdict, no exception."""
    t = np.linspace(0.0, 1.0, 11)
    extremal = Solution(
        problem=HEADING,
        solver="none",
        status=Status.DIVERGED,
        t=t,
        x=np.zeros((11, 2)),
        x0=np.zeros(2),
        costate=np.tile(costate, (11, 1)),
        u=np.zeros((11, 1)),
        control_kind="extremal",
        cost=np.inf,
    )
    verdict = evaluate(extremal, tolerance=1e-6)
    assert np.isfinite(verdict.cost)
    assert verdict.stationarity is not None
    assert verdict.stationarity > 0.1
    assert np.isfinite(costates_along(extremal).costate).all()
