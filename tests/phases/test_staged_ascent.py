"""Four phases of a rocket into its orbit, on two families of points."""

from itertools import pairwise

import numpy as np
import pytest

from models.textbook import staged_ascent
from ocp import evaluate, solve
from solvers import Collocation

OPTIMUM = -7529.712297
ASCENT = staged_ascent()


def test_masses_are_those_of_the_stages():
    """Of the guess, and so of the drops between the phases."""
    masses = [phase.start()[-1] for phase in ASCENT.phases]
    assert masses == pytest.approx([301454.0, 158183.885, 72783.770, 23464.0], abs=1e-3)


@pytest.mark.slow  # four phases of seven states
def test_two_families_of_points_bring_the_same_mass_up():
    rough = solve(ASCENT, Collocation(6)).or_raise()
    found = [
        Collocation(16, points=points).build(ASCENT).run(guess=rough).or_raise()
        for points in ("radau", "gauss")
    ]
    costs = [evaluate(each).cost for each in found]
    assert costs == pytest.approx([OPTIMUM] * 2, abs=2e-6)
    verdict = evaluate(found[0])
    assert verdict.cost_error < 1e-6
    assert verdict.violation < 1e-5
    for before, after in pairwise(found[0].phases):
        assert after.x[0, :6] == pytest.approx(before.x[-1, :6], rel=1e-9)
        assert after.costate[0] == pytest.approx(before.costate[-1], rel=1e-5)
    for phase in found[0].phases:
        sizes = np.linalg.norm(phase.control(phase.t), axis=1)
        assert sizes == pytest.approx(np.ones(len(sizes)), abs=1e-3)
