"""The problem library: every case is complete, every reference an interval that direct confirms."""

from dataclasses import replace
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cases import LIBRARY, Case, Published, Reference, all_cases
from benchmarks.cases.library.table import library_table
from benchmarks.claims.every import below_reference
from benchmarks.claims.library import library_claims, tolerance_of, within
from benchmarks.methods.library import library_methods
from benchmarks.methods.library_tolerances import INTERVALS, USUAL
from benchmarks.methods.method import Settings
from benchmarks.sweep.row import Row
from ocp import ProblemError, Status, evaluate, solve
from solvers import MultipleShooting, polish

METHODS = {method.name: method for method in library_methods()}
each = pytest.mark.parametrize("case", LIBRARY, ids=lambda case: case.name)


@each
def test_a_case_is_complete(case: Case) -> None:
    ocp = case.build()
    assert "minimise" in ocp.describe()
    assert case.source
    assert case.families
    reference = case.reference
    assert reference is not None
    assert reference.lower <= reference.value <= reference.upper
    # An interval that says nothing is no reference.
    assert reference.error <= 1e-6 * max(1.0, abs(reference.value))
    assert all(reference.upper < local for local in case.local_costs)
    if case.costate0 is not None:
        assert len(case.costate0) == ocp.model.nx


@each
def test_every_method_of_a_case_has_a_tolerance(case: Case) -> None:
    mine = [m for m in METHODS.values() if m.family in case.families]
    assert mine
    assert {m.family for m in mine} == set(case.families)
    assert all(tolerance_of(m.name, case) is not None for m in mine)


def test_the_library_is_large_and_of_all_kinds() -> None:
    assert len(LIBRARY) >= 30
    assert len({case.name for case in all_cases()}) == len(all_cases())
    assert {case.difficulty for case in LIBRARY} == {
        "easy", "smooth", "long", "nonconvex", "bang-bang", "singular", "state-constrained",
        "mixed-constrained",
    }  # fmt: skip


# Some seconds each: 61 and 168 measurements, each with a state of its own.
_LONG = {"hiv", "marine-population"}
_SOLVED = [
    pytest.param(case, id=case.name, marks=pytest.mark.slow if case.name in _LONG else ())
    for case in LIBRARY
]


@pytest.mark.many
@pytest.mark.parametrize("case", _SOLVED)
def test_direct_confirms_the_reference(case: Case) -> None:
    """The same solver, grid and tolerance as in the sweep; and its costates where known."""
    solution = solve(case.build(), MultipleShooting(INTERVALS.get(case.difficulty, USUAL)[0]))
    verdict = evaluate(solution)
    assert case.reference is not None
    tolerance = tolerance_of("direct-coarse", case)
    assert tolerance is not None
    assert solution.status.is_success
    assert abs(verdict.cost - case.reference.value) <= tolerance[0] * abs(case.reference.value)
    assert verdict.violation <= tolerance[1], verdict.worst
    if case.costate0 is not None:
        size = np.abs(case.costate0).max()
        np.testing.assert_allclose(solution.costate[0], case.costate0, atol=1e-2 * size)


OTHERS = [name for name in METHODS if name != "direct-coarse"]
# Each with every third of its cases; the first, which runs by day, is another one for the next.
THIRDS = [(name, (k + j) % 3) for k, name in enumerate(OTHERS) for j in range(3)]


@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize(("name", "third"), THIRDS)
def test_every_method_keeps_its_tolerance(name: str, third: int) -> None:
    """Every method in each run, on a third of the cases that suit it."""
    method, rows = METHODS[name], []
    for case in [case for case in LIBRARY if method.family in case.families][third::3]:
        rows.append(Row.of(case, method, Settings(), method.run(case, Settings())))
    assert not below_reference(rows)
    (claim,) = library_claims(rows)
    assert claim.holds, claim.evidence


def test_published_values_have_their_errors() -> None:
    errors = {case.name: case.errors() for case in LIBRARY if case.published}
    assert len(errors) >= 8
    assert errors["beam"] == pytest.approx([1.0923e-3], rel=1e-4)
    assert errors["bryson-denham"][0] < 0.0  # below the minimum
    assert all(np.isfinite(e).all() for e in errors.values())
    without = replace(LIBRARY[0], reference=None, published=(Published(1.0, "nobody"),))
    assert without.errors() == ()
    assert without.gap(1.0) is None


@pytest.mark.parametrize(
    ("value", "error", "how"),
    [(nan, 0.0, "x"), (inf, 0.0, "x"), (1.0, -1e-9, "x"), (1.0, nan, "x"), (1.0, inf, "x"),
     (1.0, 0.0, "")],
)  # fmt: skip
def test_bad_references(value: float, error: float, how: str) -> None:
    with pytest.raises(ProblemError, match="reference"):
        Reference(value, error, how)


def row_of(case: Case, **changes) -> Row:
    method = METHODS["direct-coarse"]
    row = Row.of(case, method, Settings(), method.run(case, Settings()))
    return replace(row, **changes)


def test_the_claims_fail_when_the_numbers_do() -> None:
    case = LIBRARY[0]
    good = row_of(case)
    assert within(good, case)
    assert not within(replace(good, cost=1.01 * 6.0), case)
    assert not within(replace(good, cost=0.99 * 6.0), case)
    assert not within(replace(good, violation=1e-3), case)
    assert not within(replace(good, status="FAILED"), case)
    assert not within(replace(good, cost=None), case)
    assert not within(replace(good, solver="unheard of"), case)
    assert not library_claims([replace(good, cost=None)])[0].holds
    assert library_claims([]) == ()
    assert below_reference([replace(good, cost=6.0 - 1e-4)])


@pytest.mark.slow
def test_an_angle_found_where_the_hamiltonian_is_concave_too() -> None:
    """Zermelo: Newton on H_u = 0 from no heading at all ends at the maximum of H."""
    (case,) = [case for case in LIBRARY if case.name == "zermelo"]
    extremal = polish(solve(case.build(), MultipleShooting(100)), accuracy=1e-10)
    verdict = evaluate(extremal)
    assert extremal.status is Status.STATIONARY  # free final time: no second-order test
    assert verdict.stationarity is not None
    assert max(verdict.stationarity, verdict.violation) < 1e-9
    gap = case.gap(verdict.cost)
    assert gap is not None
    assert abs(gap) < 1e-11


def test_the_page_holds_the_table() -> None:
    """``python -c "from benchmarks.cases.library.table import *
    print(library_table())"`` renews it."""
    page = (Path(__file__).parents[2] / "docs" / "library.md").read_text(encoding="utf-8")
    assert library_table() in page
