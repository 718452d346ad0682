"""Pictures: what is on them. How they look, people judge."""

import io
import subprocess
import sys
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from matplotlib.axes import Axes

from ocp import (
    OCP,
    Box,
    Constraint,
    FreeTime,
    Link,
    Measurement,
    Model,
    Phases,
    ProblemError,
    Rate,
    Signal,
    Soft,
    Solution,
    Unknown,
    solve,
)
from ocp.plotting.curves import curves_of
from ocp.plotting.picture import NO_LABEL
from ocp.plotting.references import references_of
from ocp.plotting.trajectory import Trajectory
from solvers import Collocation, IndirectShooting, MultipleShooting
from tests.ocp.problems import energy, lag, pendulum, trajectory

T, C, Q = (ca.SX.sym(name) for name in ("temperature", "concentration", "heating"))
WANTED, PRICE = ca.SX.sym("wanted"), ca.SX.sym("price")
REACTOR = Model(
    name="reactor",
    x=ca.vertcat(C, T),
    u=Q,
    f=ca.vertcat(-C * T / 100, Q / 100),
    x_units=("mol/l", "°C"),
    u_units=("kJ/h",),
)


def reactor(**changes) -> OCP:
    """Mixed units; a reference, a price, a soft limit, and a constraint of two variables."""
    given = {
        "name": "reactor",
        "model": REACTOR,
        "x0": [0.7, 130.0],
        "horizon": 2.0,
        "running_cost": (T - WANTED) ** 2 + PRICE * Q + 1e-6 * Q**2,
        "control_bounds": Box(-8000.0, 0.0),
        "state_bounds": Box([0.0, -np.inf], [1e3, np.inf]),
        "constraints": (
            Constraint("warm", 2 * T, upper=[250.0], soft=Soft(linear=1.0)),
            Constraint("power", T * Q, lower=-1e9),
            Constraint("end", T, 100.0, 110.0, at="terminal"),
            Constraint("gate", -T, [-120.0], [-115.0], at=[1.0]),
        ),
        "parameters": (
            Signal("wanted", WANTED, [125.0, 110.0, 105.0], hold="held"),
            Signal("price", PRICE, [0.1, 0.2, 0.3], hold="linear"),
        ),
    }
    return OCP(**(given | changes))


@pytest.fixture(scope="module")
def cooled() -> Solution:
    found = trajectory(reactor(), np.array([[-500.0], [-1500.0], [-1500.0], [-500.0]]))
    return found.with_(x=np.array([[0.7, 130], [0.6, 125], [0.5, 118], [0.4, 110], [0.35, 105]]))


def chain(links: int, unit: str = "rad") -> Solution:
    """Return a solution with many states that are alike, and a constraint of two variables."""
    x, u = ca.SX.sym("q", links), ca.SX.sym("w", links)
    units = (unit,) * links
    model = Model(name="chain", x=x, u=u, f=u, x_units=units, u_units=units)
    ocp = OCP(
        name="chain",
        model=model,
        x0=0.0,
        horizon=1.0,
        control_bounds=Box(-1.0, 2.0),
        constraints=(Constraint("pair", ca.vertcat(x[0] * u[0], x[-1] * x[0]), -1.0, [1.0, 2.0]),),
        invariants=(Constraint("zero", x[0] - x[0], 0.0, 0.0),),
    )
    return trajectory(ocp, np.sin(np.arange(5 * links)).reshape(5, links))


def legend(axes: Axes) -> list[str]:
    found = axes.get_legend()
    return [] if found is None else [text.get_text() for text in found.get_texts()]


def line(axes: Axes, label: str) -> tuple[np.ndarray, np.ndarray]:
    found = next(x for x in axes.lines if x.get_label() == label)
    t, values = found.get_data()
    return np.asarray(t), np.asarray(values)


def test_a_panel_a_variable_with_its_unit_limits_and_reference(cooled: Solution) -> None:
    picture = cooled.plot(time_unit="min")
    assert picture.names == ("concentration", "temperature", "heating", "price")
    assert [ax.get_ylabel() for ax in picture.axes] == [
        "concentration\n[mol/l]", "temperature\n[°C]", "heating\n[kJ/h]", "price"
    ]  # fmt: skip
    assert picture.axes[-1].get_xlabel() == "time [min]"
    assert legend(picture["concentration"]) == ["≥ 0 (off scale)", "≤ 1000 (off scale)"]
    warm = picture["temperature"]
    assert legend(warm) == [
        "reference: wanted", "wanted: gate", "wanted: end", "slack in use", "warm (soft)"
    ]  # fmt: skip
    t, limit = line(warm, "warm (soft)")
    np.testing.assert_allclose(limit, 125.0)  # of 2 T it is 250
    np.testing.assert_allclose(t[[0, -1]] * 60.0, [0.0, 2.0])
    assert set(line(warm, "reference: wanted")[1]) == {125.0, 110.0}  # held: the last never acts
    assert picture.get_suptitle().startswith("reactor: not converged: too few iterations, cost ")
    picture.savefig(io.BytesIO(), dpi=30)


def test_points_of_constraints_are_in_the_units_of_the_variable(cooled: Solution) -> None:
    curve = next(c for c in curves_of(cooled) if c.name == "temperature")
    end, gate = sorted(curve.points, key=lambda p: p.name)
    np.testing.assert_allclose([end.t[0], end.lower[0], end.upper[0]], [2.0, 100.0, 110.0])
    np.testing.assert_allclose([gate.t[0], gate.lower[0], gate.upper[0]], [1.0, 115.0, 120.0])


def test_held_controls_are_steps_and_extremals_are_smooth() -> None:
    held = MultipleShooting(intervals=4).build(energy()).run()
    t, u = line(held.plot()["u"], NO_LABEL)
    np.testing.assert_allclose(u, np.repeat(held.u[:, 0], 2))
    np.testing.assert_allclose(t, np.repeat(held.t, 2)[1:-1])
    extremal = IndirectShooting(segments=2, steps=4).build(energy()).run(guess=held)
    t, u = line(extremal.plot()["u"], NO_LABEL)
    assert len(t) > 100
    np.testing.assert_allclose(u, 6 - 12 * t, atol=1e-5)


def test_alike_variables_share_a_panel_up_to_six() -> None:
    picture = chain(12).plot()
    assert [len(legend(ax)) for ax in picture.axes[:4]] == [6, 6, 7, 7], "controls have bounds"
    assert picture["q_0"] is picture["q_5"] is not picture["q_6"]
    apart = chain(12, "").plot()
    assert len({apart[f"q_{i}"] for i in range(12)}) == 12, "without units nothing is alike"
    lone = chain(2)
    apart = lone.with_(x=np.linspace([0, 0], [1, 10], 6)).plot()
    assert apart["q_0"] is not apart["q_1"], "one would be flat beside the other"
    lifted = lone.with_(x=np.linspace([0, 9], [1, 10], 6)).plot()
    assert lifted["q_0"] is not lifted["q_1"], "both would be flat"


def test_constraints_are_drawn_where_active_or_asked_for() -> None:
    far = trajectory(reactor(), np.zeros((4, 1)))
    assert "power" not in far.plot().names
    assert "power" in far.plot(constraints="all").names
    assert far.plot(("power", "temperature")).names == ("power", "temperature")
    near = trajectory(chain(1).problem, np.full((4, 1), 2.0)).with_(
        x=np.linspace(0, 0.6, 5)[:, None]
    )
    assert "pair 0" in near.plot().names, "it is exceeded"
    assert "pair 0" not in near.plot(constraints="none").names
    assert near.plot(("zero",)).names == ("zero",)


def test_costates_on_request() -> None:
    solution = trajectory(energy(), np.zeros((3, 1)))
    assert not any("∂" in name for name in solution.plot().names)
    assert solution.plot(costates=True).names[-1].startswith("∂J/∂(")


def test_a_reference_is_what_the_cost_compares_with_one_variable() -> None:
    def found(cost: ca.SX) -> list[tuple[str, int]]:
        way = Trajectory.of(trajectory(reactor(running_cost=cost), np.full((4, 1), -700.0)))
        return list(references_of(way).values())

    assert found((T - WANTED) ** 2 + T**2) == [("wanted", 1)]
    assert found(ca.sqrt(1e4 + (WANTED - Q) ** 2) + C) == [("wanted", 2)]
    assert not found((T * WANTED) ** 2)
    assert not found((T + C - WANTED) ** 2), "of two variables it is a reference of neither"
    assert not found(PRICE * Q)
    way = Trajectory.of(trajectory(pendulum(), np.ones((4, 2)), "linear"))
    assert list(references_of(way).values()) == [("linear", 0)]


def test_measurements_are_points_with_their_error() -> None:
    x, k = ca.SX.sym("amount"), ca.SX.sym("k")
    model = Model(name="decay", x=x, u=ca.SX(0, 1), f=-k * x, x_units=("mg",))
    own = Measurement("sample", 2 * x + 1, [0.5, 1.0], [20.0, np.nan], [1.0])
    log = Measurement("logarithm", ca.log(x), [0.5], [2.0], 0.1)
    ocp = OCP(name="decay", model=model, x0=[10.0], horizon=1.0, data=(own, log),
              unknowns=(Unknown("k", k, 0.5),))  # fmt: skip
    solution = trajectory(ocp, np.zeros((4, 0)))
    picture = solution.plot()
    assert picture.names == ("amount", "logarithm")
    assert legend(picture["amount"]) == ["measured: sample ± σ"]
    points = curves_of(solution)[0].points[0]
    np.testing.assert_allclose(points.values, [9.5, np.nan])
    np.testing.assert_allclose(points.upper - points.lower, [1.0, np.nan])
    picture.savefig(io.BytesIO(), dpi=30)


def test_discrete_time_and_rates() -> None:
    base = lag()
    ocp = replace(base, rates=(Rate(base.model.u, -0.2, 0.2),), last_input=[0.5])
    curves = {c.name: c for c in curves_of(trajectory(ocp, np.array([[0.6], [0.5], [0.5], [0.4]])))}
    np.testing.assert_allclose(curves["rate of u"].values[::2], [0.1, -0.1, 0.0, -0.1])
    assert curves["x"].is_sampled
    smooth = energy()
    moved = replace(smooth, rates=(Rate(smooth.model.u, upper=9.0),))
    ramp = trajectory(moved, np.array([[0.0], [1.0], [3.0]]), "linear")
    rates = next(c for c in curves_of(ramp) if c.role == "rate")
    np.testing.assert_allclose(rates.values, np.repeat(np.diff(ramp.u[:, 0]) / np.diff(ramp.t), 2))


def test_algebraic_variables_have_a_panel() -> None:
    x, u, z = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("pressure")
    model = Model(name="dae", x=x, u=u, z=z, f=z, algebraic=z - x - u, z_units=("bar",))
    ocp = OCP(name="dae", model=model, x0=[1.0], horizon=1.0, running_cost=u**2,
              constraints=(Constraint("safe", z, upper=5.0),))  # fmt: skip
    picture = trajectory(ocp, np.array([[1.0], [3.0]])).plot()
    assert picture.names == ("x", "pressure", "u")
    assert legend(picture["pressure"]) == ["safe"]


# -- other axes, several solutions, phases ---------------------------------------------


def test_against_another_variable(cooled: Solution) -> None:
    picture = cooled.plot(("concentration", "heating"), against="temperature")
    assert picture.axes[-1].get_xlabel() == "temperature [°C]"
    t, _ = line(picture["heating"], NO_LABEL)
    np.testing.assert_allclose(t[[0, -1]], cooled.x[[0, -1], 1])


def test_a_phase_plane(cooled: Solution) -> None:
    picture = cooled.plot(plane=("concentration", "temperature"))
    (axes,) = picture.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("concentration [mol/l]", "temperature [°C]")
    np.testing.assert_allclose(line(axes, NO_LABEL)[1][[0, -1]], cooled.x[[0, -1], 1])
    assert legend(axes)[:2] == ["start", "end"]


def test_solutions_are_compared(cooled: Solution) -> None:
    other = trajectory(reactor(name="hotter", horizon=3.0), np.full((4, 1), -100.0))
    picture = cooled.plot(compare={"hotter": other})
    assert [t.get_text() for t in picture.legends[0].get_texts()] == ["this one", "hotter"]
    lines = [x for x in picture["temperature"].lines if x.get_label() == NO_LABEL]
    assert len(lines) == 2
    assert len({x.get_color() for x in lines}) == 2
    assert np.asarray(lines[1].get_xdata())[-1] == 3.0
    cooled.plot(compare=other, plane=("concentration", "temperature"))


def test_phases_are_named_and_what_has_one_name_is_one_curve() -> None:
    h, v, u = (ca.SX.sym(name) for name in ("height", "speed", "push"))
    ball = Model(name="ball", x=ca.vertcat(h, v), u=u, f=ca.vertcat(v, u - 9.81))
    ground = Constraint("ground", h, 0, 0, at="terminal")
    top = Constraint("top", ball.x, [1, 0], [1, 0], at="terminal")
    given = {"model": ball, "horizon": FreeTime(0.7), "running_cost": u**2 / 2}
    fall = OCP(name="fall", x0=[1, 0], constraints=(ground,), control_bounds=Box(-9, 20), **given)
    rise = OCP(name="rise", x0=[0, 3], constraints=(top,), **given)
    hop = Phases("hop", (fall, rise), (Link(ca.vertcat(h, -0.8 * v)),), total=1.5)
    found = solve(hop, Collocation(5))
    picture = found.plot()
    assert picture.names == ("height", "speed", "push")
    assert [text.get_text() for text in picture.axes[0].texts] == ["fall", "rise"]
    t, speed = line(picture["speed"], NO_LABEL)
    gap = int(np.flatnonzero(np.isnan(speed))[0])
    assert t[gap - 1] == t[gap + 1] == found.t[1]
    assert speed[gap + 1] == pytest.approx(-0.8 * speed[gap - 1])
    _, bound = line(picture["push"], "bounds")
    assert np.isfinite(bound[: gap - 1]).all()
    assert np.isnan(bound[gap:]).all()
    found.plot(compare=found, plane=("height", "speed")).savefig(io.BytesIO(), dpi=30)
    with pytest.raises(ProblemError, match="give a solution of phases"):
        found.plot(compare=found.phases[0])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"variables": ("temprature",)}, "'temprature' is nothing of 'reactor'; it has concentr"),
        ({"variables": "temperature"}, r"give their names in a tuple"),
        ({"variables": (3,)}, "an entry of variables"),
        ({"against": "way"}, "'way' is nothing of"),
        ({"time_unit": "hours"}, "'hours' is no unit of time; ms, s, min, h, d are"),
        ({"constraints": "some"}, "active, all, none are possible"),
        ({"costates": "yes"}, "costates"),
        ({"plane": ("concentration",)}, "two names are needed"),
        ({"plane": ("concentration", "way")}, "'way' is nothing of"),
        ({"plane": 3}, "plane = 3: two names are needed"),
        ({"compare": 3}, "int in it: give a Solution"),
        ({"compare": {}}, "compare is empty"),
        ({"compare": trajectory(energy(), np.zeros((3, 1)))}, "different problems have nothing"),
    ],
)
def test_what_cannot_be_drawn_is_said(cooled: Solution, options, said) -> None:
    with pytest.raises(ProblemError, match=said):
        cooled.plot(**options)


def test_a_dollar_in_a_name_is_no_formula() -> None:
    x, u = ca.SX.sym("cost $\\frac/h to $"), ca.SX.sym("u")
    ocp = OCP(name="$ and $_", model=Model(name="m", x=x, u=u, f=u, x_units=("$_$",)), x0=[0.0],
              horizon=1.0, running_cost=u**2, state_bounds=Box(-1, 1))  # fmt: skip
    solution = trajectory(ocp, np.zeros((3, 1)))
    other = {"$_{ and $": solution}
    solution.plot(compare=other).savefig(io.BytesIO(), dpi=30)
    solution.plot(plane=(str(x), "u"), compare=other).savefig(io.BytesIO(), dpi=30)


def test_a_name_may_begin_with_an_underscore() -> None:
    x, u = ca.SX.sym("_x", 2), ca.SX.sym("u")
    model = Model(name="m", x=x, u=u, f=ca.vertcat(u, u), x_units=("m", "m"))
    ocp = OCP(name="m", model=model, x0=[1.0, 1.0], horizon=1.0, running_cost=u**2)
    solution = trajectory(ocp, np.ones((3, 1)))
    panel = solution.plot()["_x_0"]
    assert legend(panel) == ["_x_0", "_x_1"]
    compared = {"_warm": solution}
    plane = solution.plot(plane=("_x_0", "_x_1"), compare=compared).axes[0]
    assert legend(plane) == ["this one", "start", "end", "_warm"]


def test_a_plane_of_what_is_never_known_together_or_of_too_many_is_refused(cooled) -> None:
    h, q, u = (ca.SX.sym(name) for name in "hqu")
    up, on = (
        OCP(
            name=str(x),
            model=Model(name=str(x), x=x, u=u, f=u),
            x0=[0.0],
            horizon=1.0,
            running_cost=u**2,
        )
        for x in (h, q)
    )
    found = solve(Phases("both", (up, on), (Link(ca.SX(0.0)),)), Collocation(3))
    with pytest.raises(ProblemError, match="h and q are never known at the same time"):
        found.plot(plane=("h", "q"))
    with pytest.raises(ProblemError, match="7 solutions in one picture, 6 at most"):
        cooled.plot(plane=("concentration", "temperature"), compare=dict.fromkeys("abcdef", cooled))


def test_axes_that_are_not_there_are_said(cooled: Solution) -> None:
    with pytest.raises(ProblemError, match="'speed' is not drawn; what is: concentration"):
        cooled.plot()["speed"]


@pytest.mark.slow
def test_drawing_leaves_pyplot_alone() -> None:
    code = (
        "import sys, numpy as np; from tests.ocp.problems import energy, trajectory;"
        "trajectory(energy(), np.zeros((3, 1))).plot();"
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
