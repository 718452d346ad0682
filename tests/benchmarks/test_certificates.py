"""The committed certificates: enough of them, digits as asked, and references that agree."""

import json

import pytest

from benchmarks.cases import LIBRARY, Case
from benchmarks.cases.library.certificates import COMMITTED, Certificates, committed
from benchmarks.cases.library.entry import certified
from solvers.certify.certify import OTHER_DIGITS, SMOOTH_DIGITS

ENTRIES = committed().entries
HOLDING = [case for case in LIBRARY if ENTRIES.get(case.name, {}).get("holds")]
# Asked of a certificate beside a derivation.
CLOSED_FORM = 1e-8


def test_every_case_of_the_library_is_on_file():
    assert {case.name for case in LIBRARY} == set(ENTRIES)


def test_at_least_25_certificates_hold():
    assert len(HOLDING) >= 25


@pytest.mark.parametrize("case", HOLDING, ids=lambda case: case.name)
def test_what_holds_has_its_digits(case: Case):
    entry, reference = ENTRIES[case.name], case.reference
    assert reference is not None
    if reference.is_closed_form:
        apart = abs(entry["cost"] - reference.value)
        assert apart <= CLOSED_FORM * max(1.0, abs(reference.value))
        return
    smooth = "indirect" in entry["estimates"][0]["method"]
    assert entry["digits"] >= (SMOOTH_DIGITS if smooth else OTHER_DIGITS)


@pytest.mark.parametrize("case", LIBRARY, ids=lambda case: case.name)
def test_reference_and_certificate_agree(case: Case):
    """Within both error bars, and what an interior-point method leaves at many active bounds."""
    lower, upper = ENTRIES[case.name]["interval"]
    reference = case.reference
    assert reference is not None
    assert lower <= reference.upper
    assert reference.lower <= upper


def test_a_certificate_that_does_not_hold_is_no_reference(monkeypatch):
    failing = Certificates(entries={"x": {"holds": False}})
    monkeypatch.setattr("benchmarks.cases.library.entry.committed", lambda: failing)
    with pytest.raises(ValueError, match="does not hold"):
        certified("x")


def test_one_that_holds_is_not_given_up():
    good, bad = {"holds": True, "cost": 1.0}, {"holds": False, "cost": 2.0}
    kept = Certificates().with_("x", good, {}).with_("x", bad, {})
    assert kept.entries["x"] == good
    better = kept.with_("x", {"holds": True, "cost": 0.5}, {})
    assert better.entries["x"]["cost"] == 0.5


def test_a_file_comes_back_and_nonsense_is_named(tmp_path):
    file = tmp_path / "deep" / "c.json"
    Certificates().with_("x", {"holds": True}, {"casadi": "3"}).write(file)
    assert Certificates.read(file) == Certificates({"casadi": "3"}, {"x": {"holds": True}})
    assert Certificates.read(tmp_path / "none.json") == Certificates()
    for text in ("{", "[]", json.dumps({"a": 1})):
        file.write_text(text)
        with pytest.raises(ValueError, match="no file of certificates"):
            Certificates.read(file)
    with pytest.raises(ValueError, match="no file of certificates"):
        Certificates.read(tmp_path)


def test_the_committed_file_has_its_versions():
    assert COMMITTED.exists()
    assert {"casadi", "numpy"} <= set(committed().versions)
