"""Many starts: distinct optima, sorted, counted, the same for the same seed."""

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases import arm_scenario
from models.textbook import double_integrator_energy, van_der_pol
from ocp import OCP, Box, Constraint, Guess, Interrupted, Model, ProblemError, Status, evaluate
from solvers import IndirectShooting, MultipleShooting, Schuetz, multistart, random_guesses
from tests.solvers.problems import changed, ends, point
from tests.tolerances import CERTIFIED

STARTS = 6
BACKENDS = ("ipopt", "native")


@pytest.mark.many
@pytest.mark.parametrize(
    ("name", "basins"), [("arm-001", (5.079, 20.722)), ("arm-003", (2.369, 2.920))]
)
def test_both_basins(name: str, basins: tuple[float, ...]) -> None:
    """The costs are those that the case library lists as local minima."""
    found = multistart(arm_scenario(name).ocp(), MultipleShooting(40), STARTS, 0)
    costs = [optimum.cost for optimum in found]
    assert costs == sorted(costs)
    np.testing.assert_allclose(costs[:2], basins, rtol=2e-3)  # 40 intervals
    assert sum(optimum.found for optimum in found) == STARTS
    for optimum in found:
        assert optimum.solution.status is Status.SOLVED
        assert evaluate(optimum.solution).cost == pytest.approx(optimum.cost, rel=CERTIFIED)


def test_the_native_backend_finds_the_same_optima() -> None:
    ocp = arm_scenario("arm-003").ocp()
    one, other = (multistart(ocp, MultipleShooting(20, backend=b), 4, 0) for b in BACKENDS)
    assert [o.found for o in one] == [o.found for o in other]
    np.testing.assert_allclose([o.cost for o in one], [o.cost for o in other], rtol=CERTIFIED)
    assert other[0].solution.build_time > 0.0


def test_the_native_backend_keeps_what_it_had_when_it_is_stopped() -> None:
    """Nothing is lost of what was solved before Ctrl-C, though no answer was looked at yet."""

    def stop(done: int, total: int, said: str = "", /) -> None:
        if said == "3 solved":
            raise KeyboardInterrupt

    solver = MultipleShooting(20, backend="native")
    with pytest.raises(Interrupted, match="multistart was stopped") as caught:
        multistart(van_der_pol(), solver, 3, 0, progress=stop)
    assert sum(optimum.found for optimum in caught.value.so_far) == 3


def test_the_seed_decides() -> None:
    ocp, solver = arm_scenario("arm-003").ocp(), Schuetz.sound(intervals=20)
    one, again, other = (multistart(ocp, solver, 3, seed) for seed in (1, 1, 2))
    assert [(o.cost, o.found) for o in one] == [(o.cost, o.found) for o in again]
    for a, b in zip(one, again, strict=True):
        np.testing.assert_array_equal(a.solution.u, b.solution.u)
    assert [o.cost for o in one] != [o.cost for o in other]


def test_more_starts_only_append() -> None:
    """The first start is the problem's own; one optimum however often it is found."""
    found = multistart(van_der_pol(), Schuetz.sound(intervals=30), 4, 0)
    assert len(found) == 1
    assert found[0].found == 4
    assert multistart(van_der_pol(), Schuetz.sound(intervals=30), 1, 0)[0].found == 1


def test_guesses_are_further_starts() -> None:
    ocp, solver = arm_scenario("arm-003").ocp(), Schuetz.sound(intervals=20)
    drawn = multistart(ocp, solver, 3, 1)
    given = multistart(ocp, solver, 1, 1, guesses=random_guesses(ocp, 2, 1))
    assert [(o.cost, o.found) for o in given] == [(o.cost, o.found) for o in drawn]
    with pytest.raises(ProblemError, match="multistart: guesses is a Guess"):
        multistart(ocp, solver, 1, 1, guesses=Guess(u=0.0))  # type: ignore[arg-type] on purpose


def test_starts_lie_within_the_bounds() -> None:
    ocp = changed(van_der_pol(), control_bounds=Box(-0.5, 0.1))
    assert multistart(ocp, MultipleShooting(20), 3, 0)[0].found == 3


def test_nothing_found() -> None:
    ocp = point(control_bounds=Box(-1, 1), constraints=ends(2.0))
    assert multistart(ocp, MultipleShooting(10), 3, 0) == ()


def test_what_the_referee_sees_violated_does_not_count() -> None:
    """A held control bends the path between two nodes: 1e-9 is more than it can promise."""
    ocp = point(
        x0=0.5,
        constraints=lambda x, u: (
            Constraint("wall", (x - 0.5) * (x - 0.5) - u, upper=0.2),
            *ends(0.8)(x, u),
        ),
    )
    assert multistart(ocp, MultipleShooting(5), 1, 0, violation=1.0)
    assert multistart(ocp, MultipleShooting(5), 1, 0, violation=0.0) == ()


def test_refuses_what_does_not_start_from_controls() -> None:
    with pytest.raises(ProblemError, match="polish the optima"):
        multistart(double_integrator_energy(), IndirectShooting(), 2, 0)


def test_a_mirror_image_is_another_optimum() -> None:
    """From y = 0 between two equal wells at -1 and 1."""
    y, u = ca.SX.sym("y"), ca.SX.sym("u")
    ocp = OCP(
        name="two wells",
        model=Model(name="integrator", x=y, u=u, f=u),
        x0=0.0,
        horizon=3.0,
        running_cost=u**2 / 10 + 4 * (y**2 - 1) ** 2,
    )
    optima = multistart(ocp, MultipleShooting(30), 8, 0)
    ends = sorted(float(optimum.solution.x[-1, 0]) for optimum in optima[:2])
    assert ends[0] < -0.9
    assert ends[1] > 0.9


def test_no_start_is_refused() -> None:
    with pytest.raises(ProblemError, match="starts must be a whole number of at least 1"):
        multistart(van_der_pol(), MultipleShooting(5), 0, 0)
