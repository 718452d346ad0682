"""The maximal output-admissible set: invariant, maximal, and what it does for a short horizon."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from models import lq_regulator, mass_spring_damper, thesis_tracking
from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    InputSource,
    Model,
    Plant,
    Status,
    UnsupportedProblem,
    linear_quadratic,
    terminal_set,
    with_terminal_set,
)
from ocp.linear.stationary import stationary
from solvers import LinearMPC

DT, FORCE, BOUND = 0.05, 6.0, 2.0
PLANT = mass_spring_damper().sampled(DT)


def regulator(steps: int = 5, **changes) -> OCP:
    """The plant 2.92 with so little force that the bounds matter."""
    given = {
        "Q": [100.0, 10.0], "R": 0.5, "P": 100.0, "x0": np.zeros(2), "horizon": steps,
        "control_bounds": Box(-FORCE, FORCE),
        "state_bounds": Box([-BOUND, -np.inf], [BOUND, np.inf]),
    }  # fmt: skip
    return lq_regulator(PLANT, **(given | changes))


def closed_loop(ocp: OCP) -> tuple[np.ndarray, np.ndarray]:
    matrices = linear_quadratic(ocp).fixed
    assert matrices is not None
    gain = stationary(matrices).K
    return PLANT.A - PLANT.B @ gain, gain


def test_a_set_by_hand():
    """x+ = 2x + u: with R = 1, Q = 0 the gain is 3/2, so |u| <= 1 allows |x| <= 2/3."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    ocp = OCP(
        name="doubling", model=Model(name="doubling", x=x, u=u, f=2 * x + u, dt=1.0), x0=0.0,
        horizon=3, running_cost=u**2 + 0 * x**2, control_bounds=Box(-1.0, 1.0),
    )  # fmt: skip
    found = terminal_set(ocp)
    assert sorted((found.d[:, None] / found.C).ravel()) == pytest.approx([-2 / 3, 2 / 3])


def test_the_regulator_never_leaves_it_and_meets_every_constraint():
    ocp, rng = regulator(), np.random.default_rng(0)
    found, (closed, gain) = terminal_set(ocp), closed_loop(regulator())
    inside = [x for x in rng.uniform([-2, -8], [2, 8], size=(4000, 2)) if found.contains(x)]
    assert 200 < len(inside) < 3000
    for x in np.array(inside):
        assert abs(x[0]) <= BOUND + 1e-9
        assert np.abs(gain @ x).max() <= FORCE + 1e-8
        assert found.contains(closed @ x, 1e-7)


def test_outside_it_the_regulator_breaks_a_constraint_some_day():
    found, (closed, gain) = terminal_set(regulator()), closed_loop(regulator())
    rng, broken = np.random.default_rng(1), 0
    for x in rng.uniform([-2, -8], [2, 8], size=(500, 2)):
        if not found.contains(x, 1e-6):
            path = [x]
            for _ in range(200):
                path.append(closed @ path[-1])
            states = np.array(path)
            assert (np.abs(states[:, 0]) > BOUND).any() or (np.abs(states @ gain.T) > FORCE).any()
            broken += 1
    assert broken > 100


@pytest.mark.many
@pytest.mark.parametrize("form", ["sparse", "condensed"])
def test_a_short_horizon_stays_feasible(form):
    """From wherever the first program is solvable all later ones are, and the mass comes home."""
    rng, solved = np.random.default_rng(2), 0
    ended_well, solver = with_terminal_set(regulator(4)), LinearMPC(form=form)
    mpc = MPC(ocp=ended_well, solver=solver, dt=DT, backup=None, least_violating=False)
    for x0 in rng.uniform([-2, -5], [2, 5], size=(20, 2)):
        run = mpc.run(Plant(ocp=regulator()), x0, 60 * DT)
        if run.ended:
            assert not len(run.inputs), "if it refuses, then at once"
            continue
        assert set(run.sources) == {InputSource.OPTIMAL}
        assert np.abs(run.x[1:, 0]).max() <= BOUND + 1e-7
        assert np.abs(run.inputs).max() <= FORCE
        assert np.abs(run.x[-1]).max() < 0.05 * max(1.0, np.abs(x0).max())
        solved += 1
    assert solved >= 5


def test_without_it_a_short_horizon_runs_into_a_dead_end():
    start = np.array([1.0, 3.3])
    run = MPC(ocp=regulator(4), solver=LinearMPC(), dt=DT).run(Plant(ocp=regulator()), start, 1.0)
    assert run.sources[0] is InputSource.OPTIMAL
    lost = next(d for d in run.decisions if d.source is not InputSource.OPTIMAL)
    assert lost.status is Status.INFEASIBLE
    assert "bound of position" in lost.message
    assert run.violation > 0.01, "no rung of the ladder leads out of a dead end"
    assert "bound of position" in run.worst or "state" in run.worst
    ended_well = LinearMPC().build(with_terminal_set(regulator(4)))
    assert ended_well.run(x0=start).status is Status.INFEASIBLE, "it tells at once"


def test_what_has_no_terminal_set_is_refused():
    with pytest.raises(UnsupportedProblem, match="reference"):
        terminal_set(thesis_tracking(5))
    with pytest.raises(UnsupportedProblem, match="two steps"):
        terminal_set(regulator(1))
    off = regulator(x0=[1.0, 0.0], state_bounds=Box([0.5, -np.inf], [2.0, np.inf]))
    with pytest.raises(UnsupportedProblem, match="origin"):
        terminal_set(off)
    x, t = PLANT.model.x, PLANT.model.t
    moving = Constraint("moving", x[0] + 0.1 * ca.sin(t), upper=1.0)
    with pytest.raises(UnsupportedProblem, match="changes with time"):
        terminal_set(replace(regulator(), constraints=(moving,)))


def test_without_constraints_it_is_the_whole_space():
    found = terminal_set(regulator(control_bounds=None, state_bounds=None))
    assert found.C.shape == (0, 2)
    assert found.contains(np.array([1e9, -1e9]))
