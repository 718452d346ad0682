"""``python -m benchmarks peers``."""

import json
from importlib import import_module
from pathlib import Path

import pytest

import benchmarks
from benchmarks.__main__ import main
from benchmarks.peers import (
    PEERS,
    BadResults,
    Entry,
    Environment,
    InstallFailed,
    NotInstalled,
    PeerReport,
    markdown,
    quicker,
    tables,
)

DATA = Path(benchmarks.__file__).parent / "data"


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


def test_list_names_peers_and_problems(capsys, empty_cache):
    assert main(["peers", "list"]) == 0
    shown = capsys.readouterr().out
    for peer in PEERS:
        assert peer.name in shown
    for problem in ("arm-mpc", "cart-pole", "linear"):
        assert problem in shown


@pytest.mark.slow
def test_a_peer_that_is_not_installed_is_said_with_what_to_type(capsys, empty_cache, tmp_path):
    out = tmp_path / "peers.json"
    words = ["peers", "run", "--peer", "qpmpc", "--problem", "linear", "--cold", "1"]
    assert main([*words, "--out", str(out)]) == 2
    heard = capsys.readouterr()
    line = "qpmpc is not installed: python -m benchmarks peers install qpmpc"
    assert line in heard.err
    assert "LinearMPC" in heard.out
    report = PeerReport.read(out)
    assert all(entry.ours for entry in report.entries)


def test_an_unknown_peer_is_refused(capsys):
    with pytest.raises(SystemExit) as end:
        main(["peers", "run", "--peer", "acado"])
    assert end.value.code == 2
    assert "no peer is called 'acado'" in capsys.readouterr().err


def test_an_environment_knows_whether_it_is_current(tmp_path):
    environment = Environment(PEERS[1], tmp_path)
    with pytest.raises(NotInstalled, match="peers install qpmpc"):
        environment.command()
    environment.folder.mkdir()
    stamp = environment.folder / "installed.txt"
    stamp.write_text("qpmpc==0.1\n", encoding="utf-8")
    assert not environment.is_installed
    stamp.write_text(PEERS[1].wanted, encoding="utf-8")
    assert environment.is_installed


def test_a_failed_installation_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.executable", "false")
    environment = Environment(PEERS[1], tmp_path)
    with pytest.raises(InstallFailed, match="qpmpc could not be installed"):
        environment.install()
    assert list(tmp_path.iterdir()) == []


def test_requirements_are_exact_versions():
    for peer in PEERS:
        for line in peer.wanted.splitlines():
            assert "==" in line, f"{peer.name}: {line}"


def entry(name: str, **values: object) -> Entry:
    measured = {"outcome": "measured", "versions": {"p": "1"}, "solves": 3, "good": 3}
    return Entry(job="j", contender=name, **{**measured, **values})  # type: ignore[arg-type]


REPORT = PeerReport(
    machine={"cores": "2"},
    load=[0.5, 0.6],
    titles={"j": "a job"},
    entries=(
        entry("mine", ours=True, cost=2.0, gap=0.0, cold=1e-3, cold_ratio=1.0, status="solved"),
        entry("quick", cost=2.0, gap=1e-9, cold=5e-4, cold_ratio=0.5, status="solved"),
        entry("wrong", cost=1.0, gap=-0.5, cold=1e-4, cold_ratio=0.1, good=0, status="solved"),
        entry("dear", cost=9.0, gap=3.5, cold=1e-4, cold_ratio=0.1, status="solved"),
        entry("away", outcome="failed", versions={}, remark="ended | with code 1", solves=0),
    ),
)


def test_a_quicker_peer_is_said_if_its_answers_are_as_good():
    assert quicker(REPORT) == [
        "quick is quicker than ours on j, cold: it takes 0.5 of the time of our quickest"
    ]


def test_tables_show_no_cost_of_what_violates_a_constraint():
    text = markdown(REPORT)
    assert "| ours: mine | 1 | 2 | +0.0e+00 |" in text
    wrong = next(line for line in text.splitlines() if "wrong" in line)
    assert "-5.0e-01" not in wrong
    assert "3 of 3 answers violate" in wrong
    assert "failed: ended / with code 1" in text
    assert [table.row_count for table in tables(REPORT)] == [5]


def test_a_report_comes_back_and_a_bad_one_is_refused(tmp_path, capsys):
    file = tmp_path / "r.json"
    REPORT.write(file)
    assert PeerReport.read(file) == REPORT
    assert main(["peers", "show", str(file)]) == 0
    assert "| quick |" in capsys.readouterr().out
    for text in ("{", "[]", '{"version": 0}', json.dumps({"version": 1, "entries": [{}]})):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(BadResults):
            PeerReport.read(file)
        assert main(["peers", "show", str(file)]) == 2
    with pytest.raises(BadResults):
        PeerReport.read(tmp_path / "none.json")


def test_the_page_shows_the_committed_results():
    page = DATA.parent.parent / "docs" / "peers.md"
    assert markdown(PeerReport.read(DATA / "peers.json")).strip() in page.read_text(
        encoding="utf-8"
    )


@pytest.mark.parametrize("name", ["control", "ssqp", "nmpyc"])
def test_what_is_missing_is_said_for_every_peer(name, capsys, empty_cache, tmp_path, monkeypatch):
    monkeypatch.setattr(import_module("benchmarks.peers.compare"), "own_contenders", lambda _: [])
    words = ["peers", "run", "--peer", name, "--problem", "linear", "--cold", "1"]
    assert main([*words, "--out", str(tmp_path / "r.json")]) == 2
    assert f"python -m benchmarks peers install {name}" in capsys.readouterr().err


@pytest.mark.slow
def test_scipy_solves_the_minimum_principle(tmp_path):
    """The one peer that needs no installation: our extremal, its boundary value solver."""
    out = tmp_path / "peers.json"
    words = ["peers", "run", "--peer", "scipy", "--problem", "cart-pole", "--cold", "1"]
    assert main([*words, "--out", str(out)]) == 0
    found = PeerReport.read(out).entries[-1]
    assert found.contender == "scipy"
    assert found.status == "solved"
    assert found.good == 1
    # The optimum with a control that is not held: below ours on a grid of 100.
    assert found.cost == pytest.approx(58.80766746, rel=1e-7)
