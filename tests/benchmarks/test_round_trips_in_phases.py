"""Every library problem of a fixed horizon, cut in two phases, has the answer that it has uncut."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.cases.case import Case
from benchmarks.cases.library.every import LIBRARY
from ocp import OCP, Guess, Phases, Signal, Solution, evaluate, solve
from solvers import Collocation, MultipleShooting
from tests.benchmarks.test_round_trips import ALIKE, FLAT

INTERVALS = 20
# Collocation imposes rows with a control at the start of each phase, where they bound two controls.
ROWS = 1e-5
# What a missed link is worth is known to first order.
TO_FIRST_ORDER = 1.2


def cut(ocp: OCP) -> Phases | None:
    """The first half with what holds at the start, the second with what holds at the end."""
    m, coupled = ocp.model, ocp.refers_to_start or ocp.at("integral")
    signals = any(isinstance(entry, Signal) for entry in ocp.parameters)
    # A control with a rate begins each phase anew, and each phase pays for a peak of its own.
    coupled = coupled or bool(ocp.rates) or bool(ocp.peaks)
    if m.is_discrete or ocp.has_free_time or ocp.unknowns or coupled or signals:
        return None
    given = {"horizon": ocp.duration / 2, "guess": None}
    at_start, at_end = ((*ocp.at("path"), *ocp.at(place)) for place in ("initial", "terminal"))
    first = replace(ocp, name="first", terminal_cost=0.0, constraints=at_start, **given)
    second = replace(ocp, name="second", constraints=at_end, **given)
    return Phases(ocp.name, (first, second))


def _halves(plain: Solution) -> tuple[Guess, Guess]:
    """The uncut answer, so that of several optima it is the same one."""
    m, at = plain.problem.model, np.linspace(0.0, 0.5, 101)
    first, second = (
        Guess(x=plain.sample("x", part, m.nx), u=plain.sample("u", part, m.nu))
        for part in (at, at + 0.5)
    )
    return first, second


@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize("case", LIBRARY, ids=lambda case: case.name)
def test_in_two_phases_it_has_the_same_answer(case: Case) -> None:
    ocp = case.build()
    phases = cut(ocp)
    if phases is None:
        pytest.skip("its halves are no problems of a fixed duration")
    for solver, halved in (
        (MultipleShooting(2 * INTERVALS), MultipleShooting(INTERVALS)),
        (Collocation(16), Collocation(8)),
    ):
        plain = solve(ocp, solver)
        if not plain.status.is_success:
            continue
        found = solve(phases, halved, guess=_halves(plain))
        size, within = 1.0 + abs(plain.cost), FLAT.get(case.name, ALIKE)
        if ocp.at("path") or ocp.state_bounds.is_active:
            within = max(within, ROWS)
        assert found.status.is_success, found.message
        assert abs(found.cost - plain.cost) <= within * size
        # A phase is integrated from its own start: what it misses there is in its error.
        there, here = evaluate(found), evaluate(plain)
        apart = abs(there.cost - here.cost)
        assert apart <= TO_FIRST_ORDER * (there.cost_error + here.cost_error) + 10 * ALIKE * size
        joined = np.vstack([found.phases[0].x, found.phases[1].x[1:]])
        assert joined.shape == plain.x.shape
