"""How smooth distances are: what is said of them, and what the search for kinks finds in a cost."""

import casadi as ca
import pytest

from models.shapes import Capsule, Cuboid, HalfSpace, Shape, Sphere, distance, distance_smoothness
from ocp import OCP, Guess, Model
from ocp.internal import RunData
from solvers import MultipleShooting
from solvers.diagnose.checks.kink import kink
from solvers.diagnose.subject import DiagnosedProblem

x, angle, u = ca.SX.sym("x", 3), ca.SX.sym("angle"), ca.SX.sym("u", 4)
_C, _S, _0, _1 = ca.cos(angle), ca.sin(angle), ca.SX(0), ca.SX(1)
TURN = ca.vertcat(
    ca.horzcat(_C, _0, _S), ca.horzcat(_0, _1, _0), ca.horzcat(-_S, _0, _C)
)  # about y
PLATE = Cuboid([1.0, 1.0, 0.2])
ROD, BOX = Capsule([-0.5, 0, 0], [0.5, 0, 0], 0.1), Cuboid([0.8, 0.4, 0.4])


@pytest.mark.parametrize(
    ("moving", "other", "expected"),
    [
        (Sphere(0.1).at(x), Sphere(0.1), 2),
        (Sphere(0.1).at(x), HalfSpace([0, 0, 1]), 2),
        (Sphere(0.1).at(x), PLATE, 1),
        (Sphere(0.1).at(x), ROD, 1),
        pytest.param(ROD.at(x), PLATE, 1, marks=pytest.mark.slow),
        (ROD.at(x, TURN), PLATE, 0),
        pytest.param(BOX.at(x, TURN), PLATE, 0, marks=pytest.mark.slow),
        (ROD.at(x, TURN), HalfSpace([0, 0, 1], -2.0), 0),
    ],
)
def test_what_is_said_is_what_is_found(moving: Shape, other: Shape, expected: int) -> None:
    """A body that passes over the other and tilts from one side to the other."""
    assert distance_smoothness(moving, other) == expected
    assert distance_smoothness(other, moving) == expected
    for declared in (0, 1, 2):
        if declared not in (expected, expected + 1):
            continue
        ocp = OCP(
            name="near",
            model=Model(name="body", x=ca.vertcat(x, angle), u=u, f=u),
            x0=[-0.3, 0.0, 1.0, -0.6],
            horizon=1.0,
            running_cost=ca.sumsqr(u) + distance(moving, other) ** 2,
            smoothness=declared,
            guess=Guess(u=[0.6, 0.0, 0.0, 1.2]),
        )
        data = RunData(ocp.start(), 0.0, ocp.parameter_values())
        found = list(kink(DiagnosedProblem(ocp, data, MultipleShooting(20))))
        assert bool(found) == (expected < declared)
        if found:  # a decision has many values, and is named once
            assert min(f.evidence for f in found) == expected
            assert len([f for f in found if "decides" in f.sentence]) <= 1
