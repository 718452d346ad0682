"""The committed certificates: enough of them, digits as asked, and references that agree."""

import json

import pytest

from benchmarks.cases import LIBRARY, PHASES, Case, PhasesCase
from benchmarks.cases.library.certificates import COMMITTED, FORMAT, Certificates, committed
from benchmarks.cases.library.entry import certified
from solvers.certify.estimate_checks import OTHER_DIGITS, SMOOTH_DIGITS

ENTRIES = committed().entries
# Without a certificate: references by derivation, by scipy (tests/models/test_estimations.py), or
# by two families of points; polishing the estimations takes minutes.
UNCERTIFIED = {
    "alpha-pinene",
    "hiv",
    "marine-population",
    "methanol",
    "staged-ascent",
    "tuberculosis",
}
ALL = tuple(case for case in (*LIBRARY, *PHASES) if case.name not in UNCERTIFIED)
HOLDING = [case for case in ALL if ENTRIES.get(case.name, {}).get("holds")]
# Asked of a certificate beside a derivation.
CLOSED_FORM = 1e-8


def test_every_case_of_the_library_is_on_file():
    assert {case.name for case in ALL} == set(ENTRIES)


def test_every_certificate_holds():
    assert [name for name, entry in ENTRIES.items() if not entry["holds"]] == []


@pytest.mark.parametrize("case", HOLDING, ids=lambda case: case.name)
def test_what_holds_has_its_digits(case: Case | PhasesCase):
    entry, reference = ENTRIES[case.name], case.reference
    assert reference is not None
    if reference.is_closed_form:
        apart = abs(entry["cost"] - reference.value)
        assert apart <= CLOSED_FORM * max(1.0, abs(reference.value))
        return
    smooth = entry["estimates"][0]["method"].startswith("indirect multiple shooting")
    assert entry["digits"] >= (SMOOTH_DIGITS if smooth else OTHER_DIGITS)


@pytest.mark.parametrize("case", ALL, ids=lambda case: case.name)
def test_reference_and_certificate_agree(case: Case | PhasesCase):
    """Within both error bars, and what an interior-point method leaves at many active bounds."""
    lower, upper = ENTRIES[case.name]["interval"]
    reference = case.reference
    assert reference is not None
    assert lower <= reference.upper
    assert reference.lower <= upper


def test_a_certificate_that_does_not_hold_or_is_missing_is_no_reference(monkeypatch):
    """A new case is there before its certificate, or it could not be certified."""
    failing = Certificates(entries={"x": {"holds": False}})
    monkeypatch.setattr("benchmarks.cases.library.entry.committed", lambda: failing)
    assert certified("x") is None
    assert certified("new") is None


def test_one_that_holds_is_not_given_up():
    good, bad = {"holds": True, "cost": 1.0}, {"holds": False, "cost": 2.0}
    kept = Certificates().with_("x", good, {}).with_("x", bad, {})
    assert kept.entries["x"] == {**good, "versions": {}}
    better = kept.with_("x", {"holds": True, "cost": 0.5}, {})
    assert better.entries["x"]["cost"] == 0.5


def test_a_file_comes_back_and_nonsense_is_named(tmp_path):
    file = tmp_path / "deep" / "c.json"
    written = Certificates().with_("x", {"holds": True}, {"casadi": "3"})
    written.write(file)
    assert Certificates.read(file) == written
    assert written.entries["x"]["versions"] == {"casadi": "3"}
    assert Certificates.read(tmp_path / "none.json") == Certificates()
    no_versions = {"format": FORMAT, "cases": {"x": {"holds": True}}}
    for content in ("{", "[]", json.dumps({"a": 1}), json.dumps(no_versions)):
        file.write_text(content)
        with pytest.raises(ValueError, match="no file of certificates"):
            Certificates.read(file)
    with pytest.raises(ValueError, match="no file of certificates"):
        Certificates.read(tmp_path)


def test_versions_stay_with_their_entry():
    old = Certificates().with_("x", {"holds": True}, {"casadi": "3"})
    both = old.with_("y", {"holds": True}, {"casadi": "4"})
    assert both.entries["x"]["versions"] == {"casadi": "3"}
    assert both.entries["y"]["versions"] == {"casadi": "4"}


def test_a_file_of_another_format_is_refused(tmp_path):
    file = tmp_path / "c.json"
    file.write_text(json.dumps({"format": FORMAT + 1, "cases": {}}))
    with pytest.raises(ValueError, match=f"has format {FORMAT + 1}"):
        Certificates.read(file)


@pytest.mark.parametrize("name", ENTRIES)
def test_every_committed_entry_has_its_versions(name: str):
    assert COMMITTED.exists()
    assert {"casadi", "numpy"} <= set(ENTRIES[name]["versions"])
