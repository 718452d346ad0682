"""Bang-bang and singular references once more, from the arcs of the minimum principle."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from benchmarks.cases import LIBRARY
from models.textbook import goddard, pendulum_minimum_time, polar_arm, two_link_arm_minimum_time
from ocp import OCP
from tests.tolerances import CERTIFIED

CASES = {case.name: case for case in LIBRARY}
STEPS = 300

# -- bang-bang: the switching times are the unknowns -----------------------------------------


def least_time(
    ocp: OCP, first: Sequence[float], switches: Sequence[Sequence[float]], end: float
) -> float:
    """Minimise the final time over the switches of every control, RK4 steps between them."""
    x, u, h = ca.SX.sym("x", ocp.model.nx), ca.SX.sym("u", ocp.model.nu), ca.SX.sym("h")
    f = ca.Function("f", [ocp.model.x, ocp.model.u], [ocp.model.f])
    k1 = f(x, u)
    k2 = f(x + h / 2 * k1, u)
    k3 = f(x + h / 2 * k2, u)
    after = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(x + h * k3, u))
    arc = ca.Function("step", [x, u, h], [after]).mapaccum(STEPS)
    guess = [(t, i) for i, times in enumerate(switches) for t in times]
    unknown = ca.MX.sym("switches and end", len(guess) + 1)
    low, high = np.asarray(ocp.control_bounds.lower), np.asarray(ocp.control_bounds.upper)
    state, t, side = ca.MX(ca.DM(ocp.start())), ca.MX(0.0), np.array(first)
    for k in [*np.argsort([g[0] for g in guess]), len(guess)]:
        held = ca.repmat(ca.DM(np.where(side > 0, high, low)), 1, STEPS)
        state = arc(state, held, ca.repmat((unknown[int(k)] - t) / STEPS, 1, STEPS))[:, -1]
        t = unknown[int(k)]
        if k < len(guess):
            side[guess[k][1]] *= -1
    (target,) = ocp.at("terminal")
    program = {"x": unknown, "f": unknown[-1], "g": state - ca.DM(np.asarray(target.lower))}
    options = {"print_time": False, "ipopt.print_level": 0, "ipopt.tol": 1e-13, "ipopt.sb": "yes"}
    solver = ca.nlpsol("switching", "ipopt", program, options)
    found = solver(x0=[*(g[0] for g in guess), end], lbg=0.0, ubg=0.0)
    assert solver.stats()["success"]
    return float(found["f"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "build", "first", "switches"),
    [
        ("pendulum-minimum-time", pendulum_minimum_time, [-1], [[2.37, 6.33]]),
        (
            "two-link-arm-minimum-time",
            two_link_arm_minimum_time,
            [-1, 1],
            [[0.058, 0.615], [0.414, 0.880]],
        ),
        ("polar-arm", polar_arm, [-1, 1, -1], [[2.28, 6.86], [4.57], [2.8, 6.34]]),
    ],
)
def test_switching_times(name, build, first, switches) -> None:
    reference = CASES[name].reference
    assert reference is not None
    found = least_time(build(), first, switches, reference.value)
    assert found == pytest.approx(reference.value, abs=2 * reference.error, rel=CERTIFIED)


# -- Goddard: full thrust, singular, perhaps along the limit, none --------------------------------


class Rocket:
    """Flows of state and costate under each kind of thrust; ψ is that of the maximum of r."""

    def __init__(self) -> None:
        ocp = goddard()
        x, thrust, p = ocp.model.x, ocp.model.u, ca.SX.sym("p", 3)
        free = ca.substitute(ocp.model.f, thrust, 0.0)
        push = ca.jacobian(ocp.model.f, thrust)
        h0, h1 = ca.dot(p, free), ca.dot(p, push)

        def bracket(a: ca.SX, b: ca.SX) -> ca.SX:
            return ca.dot(ca.gradient(a, p), ca.gradient(b, x)) - ca.dot(
                ca.gradient(a, x), ca.gradient(b, p)
            )

        def flow(u: ca.SX, multiplier: ca.SX) -> ca.Function:
            h = h0 + thrust * h1
            rate = ca.vertcat(ca.gradient(h, p), -ca.gradient(h, x) - multiplier * limit)
            return ca.Function("flow", [x, p], [ca.substitute(rate, thrust, u)])

        limit = ca.gradient(x[1], x)
        h01 = bracket(h0, h1)
        singular = -bracket(h0, h01) / bracket(h1, h01)
        along = -free[1] / push[1]
        zero = ca.SX(0.0)
        self.arcs = {
            "full": flow(ca.SX(3.5), zero),
            "singular": flow(singular, zero),
            "limit": flow(along, h01 / push[1]),
            "none": flow(zero, zero),
        }
        self.signs = ca.Function("signs", [x, p], [h0, h1, h01])

    def run(self, arc: str, z: np.ndarray, duration: float) -> np.ndarray:
        flow = self.arcs[arc]

        def rate(t: float, y: np.ndarray) -> np.ndarray:
            return np.array(flow(y[:3], y[3:])).ravel()

        span = (0.0, duration)
        return solve_ivp(rate, span, z, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]

    def shoot(self, unknown: np.ndarray, arcs: Sequence[str]) -> tuple[list[float], float]:
        """Residuals of (ψ(0), ends of the arcs), and the height reached."""
        z, before, residuals = np.array([1.0, 0.0, 1.0, *unknown[:3]]), 0.0, []
        for arc, end in zip(arcs, unknown[3:], strict=True):
            if arc == "singular":
                _, h1, h01 = self.signs(z[:3], z[3:])
                residuals += [float(h1), float(h01)]
            if arc == "limit":
                residuals.append(z[1] - 0.1)
            z, before = self.run(arc, z, end - before), end
        h0 = self.signs(z[:3], z[3:])[0]
        return [*residuals, z[2] - 0.6, z[3] - 1.0, z[4], float(h0)], float(z[0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "arcs", "ends"),
    [
        ("goddard", ("full", "singular", "none"), (0.0235, 0.0727, 0.1989)),
        ("goddard-slow", ("full", "singular", "limit", "none"), (0.0235, 0.0597, 0.1016, 0.2020)),
    ],
)
def test_the_rocket_on_its_arcs(name, arcs, ends) -> None:
    case, rocket = CASES[name], Rocket()
    assert case.reference is not None
    assert case.costate0 is not None
    near = [*(-np.array(case.costate0)), *ends]
    found: Any = fsolve(lambda z: rocket.shoot(z, arcs)[0], near, xtol=1e-13)
    residuals, height = rocket.shoot(found, arcs)
    np.testing.assert_allclose(residuals, 0.0, atol=1e-11)
    assert -height == pytest.approx(case.reference.value, abs=case.reference.error)
    np.testing.assert_allclose(-found[:3], case.costate0, rtol=1e-6)
