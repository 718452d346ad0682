"""Pictures of closed loops: what is on them."""

import io
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    FeedbackLaw,
    Model,
    Plant,
    ProblemError,
    Rollout,
    Signal,
    closed_loop,
)
from ocp.plotting.picture import NO_LABEL
from solvers import MultipleShooting
from tests.ocp.test_plot import legend, line

DT, STEPS = 0.1, 12
X, V, F, WANTED = (ca.SX.sym(name) for name in ("position", "speed", "force", "wanted"))


def cart(mass: float = 1.0, fastest: float = 0.7) -> OCP:
    """A cart that follows a reference, and is neither too fast nor too strong."""
    model = Model(name="cart", x=ca.vertcat(X, V), u=F, f=ca.vertcat(V, F / mass),
                  x_units=("m", "m/s"), u_units=("N",))  # fmt: skip
    return OCP(
        name="cart",
        model=model,
        x0=[1.0, 0.0],
        horizon=1.0,
        running_cost=10 * (X - WANTED) ** 2 + V**2 + 0.1 * F**2,
        control_bounds=Box(-2.0, 2.0),
        constraints=(
            Constraint("not too fast", V, -fastest, fastest),
            Constraint("power", F * V, -9, 9),
        ),
        parameters=(Signal("wanted", WANTED, np.zeros(11)),),
    )


def ahead(t: float) -> dict[str, np.ndarray]:
    return {"wanted": np.where(t + np.linspace(0.0, 1.0, 11) > 0.95, 0.5, 0.0)}


def broken(x: np.ndarray, t: float) -> np.ndarray:
    """A sensor that is silent for two steps, and once far off."""
    if 0.45 < t < 0.65:
        return np.full(2, np.nan)
    return x + 50.0 * (abs(t - 0.9) < 0.01)


@pytest.fixture(scope="module")
def faulty() -> Rollout:
    mpc = MPC(ocp=cart(), solver=MultipleShooting(10), dt=DT, compiled=False, parameters=ahead)
    plant = Plant(ocp=cart(1.2, fastest=0.5), measurement_noise=[0.01, 0.02])
    return closed_loop(mpc, plant, [1.0, 0.0], STEPS * DT, dt=DT, sensors=broken)


def test_states_inputs_limits_reference_and_what_was_told(faulty: Rollout) -> None:
    picture = faulty.plot()
    assert picture.names == ("position", "speed", "force", "running cost")
    told = "measured (1 off scale, 2\nmissing)"
    assert legend(picture["position"]) == [told, "reference: wanted"]
    assert legend(picture["speed"])[:2] == [told, "not too fast"]
    assert legend(picture["force"]) == ["bounds"]
    t, wanted = line(picture["position"], "reference: wanted")
    np.testing.assert_allclose(wanted, np.where(t > 0.95, 0.5, 0.0)[: len(t)], atol=0.5)
    assert set(wanted) == {0.0, 0.5}
    low, high = picture["position"].get_ylim()
    assert high - low < 3.0, "a broken sensor hides no curve"
    _, force = line(picture["force"], NO_LABEL)
    np.testing.assert_allclose(force, np.repeat(faulty.inputs[:, 0], 2))
    picture.savefig(io.BytesIO(), dpi=30)


def test_every_rung_that_acted_has_a_shade_in_the_legend(faulty: Rollout) -> None:
    picture = faulty.plot()
    said = [text.get_text() for text in picture.legends[0].get_texts()]
    expected = [f"{s.name.lower().replace('_', ' ')} ({n} of 12)" for s, n in faulty.counts.items()
                if n]  # fmt: skip
    assert said == expected
    assert len(said) > 1
    shades = [patch for patch in picture["speed"].patches if patch.get_alpha()]
    assert shades, "the background is coloured where no plan was optimal"


def test_plans_on_request(faulty: Rollout, tmp_path: Path) -> None:
    plans = [x for x in faulty.plot(plans=4)["position"].lines if x.get_label() == "plan"]
    assert len(plans) == 3
    plan = faulty.decisions[4].plan
    assert plan is not None
    np.testing.assert_allclose(np.asarray(plans[1].get_ydata()), plan.x[:, 0])
    loaded = Rollout.load(faulty.save(tmp_path / "loop"), faulty.plant).plot(plans=1)
    assert "plan" not in legend(loaded["position"])


def test_loops_are_compared_and_drawn_over_each_other(faulty: Rollout) -> None:
    law = FeedbackLaw(law=lambda x, t: [-x[0] - x[1]])
    other = closed_loop(law, Plant(ocp=cart()), [1.0, 0.0], 0.5, dt=DT)
    picture = faulty.plot(compare={"law": other}, time_unit="ms")
    assert [t.get_text() for t in picture.legends[0].get_texts()] == ["this one", "law"]
    assert "law: closed-loop cost" in picture.get_suptitle()
    (axes,) = faulty.plot(plane=("position", "speed"), compare={"law": other}).axes
    assert "not too fast" in legend(axes)
    over = other.plot(("force",), against="position")
    assert over.axes[0].get_xlabel() == "position [m]"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"variables": ("thrust",)}, "'thrust' is nothing of 'cart'; it has position, speed"),
        ({"time_unit": "m"}, "no unit of time"),
        ({"plans": -1}, "plans"),
        ({"plans": 0.5}, "plans"),
        ({"compare": "other"}, "give a Rollout"),
    ],
)
def test_what_cannot_be_drawn_is_said(faulty: Rollout, options, said) -> None:
    with pytest.raises(ProblemError, match=said):
        faulty.plot(**options)


def test_a_table_says_for_each_constraint_how_much_and_when(
    faulty: Rollout, tmp_path: Path
) -> None:
    table = faulty.violations
    assert [row.name for row in table.rows] == ["bound of force", "not too fast", "power"]
    fast = table["not too fast"]
    assert (fast.amount, fast.unit) == (pytest.approx(faulty.violation), "m/s")
    assert f"{fast.amount:.3g} at t = {fast.t:.4g} s" in faulty.worst
    assert str(table["power"]) == "power: kept"
    assert str(table).splitlines()[0].split() == [
        "constraint",
        "largest",
        "violation",
        "when",
        "[s]",
    ]
    assert "m/s" in str(table).splitlines()[2]
    with pytest.raises(KeyError, match="they are bound of force, not too fast, power"):
        table["thrust"]
    loaded = Rollout.load(faulty.save(tmp_path / "loop"), faulty.plant)
    assert loaded.violations == table
