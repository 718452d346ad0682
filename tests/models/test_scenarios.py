"""The random scenarios: the same every time, and as hard as their label says."""

import numpy as np
import pytest

from models import ArmScenario, link_distances, random_scenarios
from ocp import ProblemError

DIFFICULTIES = ("ordinary", "tight", "low gain", "infeasible")


@pytest.mark.many
@pytest.mark.parametrize("difficulty", DIFFICULTIES)
def test_same_arguments_same_scenarios(difficulty: str) -> None:
    first = random_scenarios(4, 3, seed=7, difficulty=difficulty)  # type: ignore[arg-type]
    assert first == random_scenarios(4, 3, seed=7, difficulty=difficulty)  # type: ignore[arg-type]
    assert first[:2] == random_scenarios(4, 2, seed=7, difficulty=difficulty)  # type: ignore[arg-type]
    assert first != random_scenarios(4, 3, seed=8, difficulty=difficulty)  # type: ignore[arg-type]
    assert len({s.name for s in first}) == 3


@pytest.mark.many
@pytest.mark.parametrize("links", range(3, 13))
def test_every_number_of_links_gives_well_posed_problems(links: int) -> None:
    (scenario,) = random_scenarios(links, 1, seed=0)
    assert sum(scenario.lengths) == pytest.approx(3.0)
    assert scenario.arm.n == links
    singular_values = np.linalg.svd(np.array(scenario.arm.jacobian(scenario.theta0)))[1]
    assert singular_values.min() > 0.25
    ocp = scenario.ocp("closest", correction=1.0, clearance=scenario.radius)
    assert ocp.model.nx == links
    assert np.isfinite(
        float(ocp.functions.running_cost(np.asarray(ocp.x0), np.zeros(links), 0.0, []))
    )


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
def test_label_and_start(difficulty: str) -> None:
    for s in random_scenarios(5, 5, seed=3, difficulty=difficulty):  # type: ignore[arg-type]
        aside = s.path_clearance - s.radius
        assert s.label == difficulty
        assert (aside < 0.0) == (difficulty == "infeasible")
        assert (aside <= 0.1) == (difficulty in ("tight", "infeasible"))
        assert (s.gain <= 5.0) == (difficulty == "low gain")
        distances = np.array(link_distances(s.arm, s.theta0, s.disc), dtype=float)
        assert distances.min() > s.radius


def test_path_clearance_of_a_known_scenario() -> None:
    s = ArmScenario(
        name="arm-034",
        theta0=(2.4, -1.5, -1.5),
        obstacle=(1.0, 1.0),
        radius=0.2,
        influence=0.8,
        gain=500.0,
        velocity=(0.4, 0.0),
    )
    assert s.path_clearance == pytest.approx(0.106, abs=5e-4)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"links": 2, "count": 1}, "links = 2, it must be 3 to 12"),
        ({"links": 13, "count": 1}, "links = 13"),
        ({"links": 3.5, "count": 1}, "links must be a whole number of at least 1, not 3.5"),
        ({"links": 3, "count": 0}, "count must be a whole number of at least 1, not 0"),
        ({"links": 3, "count": 1, "difficulty": "brutal"}, "difficulty = 'brutal'"),
    ],
)
def test_bad_arguments(arguments: dict, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        random_scenarios(**arguments, seed=0)
