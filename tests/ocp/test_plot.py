"""Figures: what is on them. How they look, people judge."""

import io
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest
from matplotlib.figure import Figure

from ocp import OCP, Box, Constraint, Model, Solution
from ocp.plotting.solution import plot_solution
from solvers import IndirectShooting, MultipleShooting
from tests.ocp.problems import energy, pendulum, trajectory


def chain(links: int) -> Solution:
    """Return a solution with many states, path constraints of two rows, and an invariant."""
    x, u = ca.SX.sym("q", links), ca.SX.sym("w", links)
    model = Model(name="chain", x=x, u=u, f=u, x_units=("rad",) * links, u_units=("rad/s",) * links)
    ocp = OCP(
        name="chain",
        model=model,
        x0=0.0,
        horizon=1.0,
        control_bounds=Box(-1.0, 2.0),
        state_bounds=Box(-99.0, 99.0),
        constraints=(Constraint("pair", ca.vertcat(x[0] * u[0], x[-1]), -1.0, [1.0, 2.0]),),
        invariants=(Constraint("zero", x[0] - x[0], 0.0, 0.0),),
    )
    u = np.sin(np.arange(5 * links)).reshape(5, links)
    return trajectory(ocp, u)


def panels(figure: Figure) -> list[str]:
    return [ax.get_ylabel() for ax in figure.axes]


def legend(figure: Figure, panel: int) -> list[str]:
    found = figure.axes[panel].get_legend()
    assert found is not None
    return [text.get_text() for text in found.get_texts()]


@pytest.mark.parametrize("links", [1, 12])
def test_every_panel_is_there_and_named(links: int) -> None:
    figure = plot_solution(chain(links))
    titles = ["states [rad]", "controls [rad/s]", "costates", "path constraints", "invariants"]
    assert panels(figure) == titles
    assert figure.axes[-1].get_xlabel() == "time [s]"
    assert len(legend(figure, 0)) == links
    assert legend(figure, 3) == ["pair 0", "pair 1"]
    assert legend(figure, 4) == ["zero"]
    assert figure.get_suptitle() == "chain: iteration limit, own cost 0"
    figure.savefig(io.BytesIO(), dpi=30)


def test_bounds_that_are_near_are_drawn_dashed() -> None:
    solution = chain(3)
    figure = plot_solution(solution)
    dashed = [[line for line in ax.lines if line.is_dashed()] for ax in figure.axes]
    heights = [[float(np.asarray(line.get_ydata())[0]) for line in lines] for lines in dashed]
    assert heights == [[-99.0, 99.0], [-1.0, 2.0], [], [-1.0, 1.0, 2.0], [0.0]]
    moving = solution.with_(x=np.linspace(0.0, 1.0, 18).reshape(6, 3))
    assert not any(line.is_dashed() for line in plot_solution(moving).axes[0].lines)


def test_no_constraints_no_panels_and_units_where_they_differ() -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    model = Model(name="cart", x=x, u=u, f=ca.vertcat(x[1], u), x_units=("m", "m/s"))
    ocp = OCP(name="cart", model=model, x0=0.0, horizon=1.0)
    figure = trajectory(ocp, np.zeros((3, 1))).plot()
    assert panels(figure) == ["states", "controls", "costates"]
    assert legend(figure, 0) == ["x_0 [m]", "x_1 [m/s]"]
    assert legend(figure, 1) == ["u"]


def test_held_controls_are_steps_and_extremals_are_smooth() -> None:
    held = MultipleShooting(intervals=4).build(energy()).run()
    line = plot_solution(held).axes[1].lines[0]
    assert line.get_drawstyle() == "steps-post"
    np.testing.assert_allclose(np.asarray(line.get_ydata()), np.append(held.u, held.u[-1]))
    extremal = IndirectShooting(segments=2, steps=4).build(energy()).run(guess=held)
    t, u = (np.asarray(d) for d in plot_solution(extremal).axes[1].lines[0].get_data())
    assert len(t) > 100
    np.testing.assert_allclose(u, 6 - 12 * t, atol=1e-6)


def test_linear_controls_and_signals() -> None:
    base = pendulum()
    m = base.model
    held = base.parameters[1].symbol
    ocp = pendulum(
        model=m,
        running_cost=base.running_cost,
        terminal_cost=base.terminal_cost,
        parameters=base.parameters,
        constraints=(Constraint("signal", held + 0 * m.x[0], -2.0, 2.0),),
    )
    figure = plot_solution(trajectory(ocp, np.ones((4, 2)), "linear"))
    assert figure.axes[1].lines[0].get_drawstyle() == "default"
    rows = np.asarray(figure.axes[3].lines[0].get_ydata())
    np.testing.assert_allclose(rows, [0.5, -0.5, 1.0, 0.3])


@pytest.mark.slow
def test_drawing_leaves_pyplot_alone() -> None:
    code = (
        "import sys, numpy as np; from tests.ocp.problems import energy, trajectory;"
        "trajectory(energy(), np.zeros((3, 1))).plot();"
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
