"""``python -m benchmarks certify``: what is on file, and what it says of it."""

from pathlib import Path

import pytest

from benchmarks.__main__ import main
from benchmarks.cases import all_cases
from benchmarks.cases.library.certificates import Certificates
from benchmarks.sweep.row import versions
from solvers import Certificate, MultipleShooting
from solvers.certify.certificate import Check, Estimate, Verdict


def certificate(verdict: Verdict) -> Certificate:
    case = all_cases()[0]
    answer = MultipleShooting(10).build(case.build()).run()
    estimates = [Estimate(name, 1.0, 1e-9, 0.0, answer, "") for name in ("one", "other")]
    return Certificate(case.name, tuple(estimates), (Check("agreement", verdict, ""),))


@pytest.mark.parametrize(("verdict", "code"), [(Verdict.HOLDS, 0), (Verdict.FAILS, 1)])
def test_what_does_not_hold_is_said_again_from_the_file(
    tmp_path: Path, monkeypatch, capsys, verdict: Verdict, code: int
) -> None:
    file, name = tmp_path / "certificates.json", all_cases()[0].name
    Certificates().with_(name, certificate(verdict).as_dict(), versions()).write(file)
    monkeypatch.setattr("benchmarks.commands.certify._wanted", lambda _: [all_cases()[0]])
    assert main(["certify", "--file", str(file)]) == code
    assert ("NOT certified" in capsys.readouterr().out) == bool(code)


def test_a_file_is_read_back(tmp_path: Path) -> None:
    file = tmp_path / "certificates.json"
    assert not Certificates.read(file).entries
    written = Certificates().with_("a", certificate(Verdict.HOLDS).as_dict(), versions())
    written.write(file)
    assert Certificates.read(file) == written
    file.write_text("{}")
    with pytest.raises(ValueError, match="no file of certificates"):
        Certificates.read(file)
