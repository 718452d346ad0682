"""Peers that answer, refuse, crash, hang or talk nonsense: each costs its own row only."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.peers import Environment, PeerPackage
from benchmarks.peers import contender as contenders
from benchmarks.peers.contender import OwnContender, PeerContender
from benchmarks.peers.conversation import Conversation, PeerFailed
from benchmarks.peers.job import Job, Situation
from benchmarks.peers.race import race
from models.textbook import double_integrator_energy
from ocp import Box
from solvers import MultipleShooting
from tests.benchmarks.peers.fakes import FAKE


@pytest.fixture
def job():
    ocp = replace(double_integrator_energy(), control_bounds=Box(-20.0, 20.0))
    start = ocp.start()
    near = Situation(start + 0.01, 0.1)
    return Job(name="j", title="a job", ocp=ocp, intervals=6, situations=(Situation(start), near))


@pytest.fixture
def peer(tmp_path):
    (tmp_path / "fake.py").write_text(FAKE, encoding="utf-8")
    return PeerPackage("fake", "a fake", "fake.py", folder=tmp_path)


def run(job, peer, *settings, limit=5.0):
    others = [PeerContender(peer, s, Environment(peer), limit) for s in settings]
    own = OwnContender("ours", MultipleShooting(job.intervals))
    return {entry.contender: entry for entry in race(job, [own, *others], cold=2)}


def test_the_referee_judges_what_a_peer_answers(job, peer):
    found = run(job, peer, "idle")
    ours, idle = found["ours"], found["fake, idle"]
    assert ours.ours
    assert ours.outcome == "measured"
    assert ours.gap == 0.0
    assert ours.cold_ratio == ours.warm_ratio == 1.0
    assert ours.good == ours.solves == 1
    assert idle.outcome == "measured"
    assert idle.versions == {"fake": "1.2"}
    assert idle.remark == "fake"
    assert idle.cold == 1e-9
    # It moves nothing, whatever it says: the end is missed.
    assert idle.status == "solved"
    assert idle.good == 0
    assert idle.violation == pytest.approx(1.0, abs=0.1)


def test_one_that_fails_costs_its_row_only(job, peer, monkeypatch):
    monkeypatch.setattr(contenders, "BUILD_LIMIT", 1.0)
    found = run(job, peer, "crash", "hang", "garbage", "cannot", "nan", "poor", "idle")
    outcomes = {name: entry.outcome for name, entry in found.items()}
    assert outcomes == {
        "ours": "measured",
        "fake, crash": "failed",
        "fake, hang": "failed",
        "fake, garbage": "failed",
        "fake, cannot": "cannot treat it",
        "fake, nan": "failed",
        "fake, poor": "failed",
        "fake, idle": "measured",
    }
    said = {name: entry.remark for name, entry in found.items()}
    assert said["fake, crash"] == "ended with code 1; its last words: no such thing as a fake.so"
    assert said["fake, hang"] == "hung: no answer to 'build' in 1 s; its last words: thinking"
    assert said["fake, garbage"].startswith("spoke no JSON: 'hello'")
    assert said["fake, cannot"] == "not my kind of problem"
    assert said["fake, nan"].startswith("its answer is not finite")
    assert "'u'" in said["fake, poor"]


def test_one_that_does_not_listen_is_stopped_too(tmp_path):
    (tmp_path / "deaf.py").write_text("import time; time.sleep(60)", encoding="utf-8")
    command = [sys.executable, str(tmp_path / "deaf.py")]
    with Conversation(command) as deaf, pytest.raises(PeerFailed, match="hung: no answer to 'x'"):
        deaf.ask({"do": "x", "much": "more than a pipe holds" * 100_000}, limit=0.5)


def test_one_that_cannot_be_started_is_a_row_too(job, peer, monkeypatch):
    monkeypatch.setattr(sys, "executable", "no-such-python")
    found = run(job, peer, "idle")
    assert found["fake, idle"].outcome == "failed"
    assert found["fake, idle"].remark.startswith("did not start")


def test_a_slow_one_is_asked_no_more(job, peer, monkeypatch):
    monkeypatch.setattr("benchmarks.peers.race.PATIENCE", 1e-9)
    entry = run(job, peer, "idle")["fake, idle"]
    assert entry.outcome == "measured"
    assert entry.warm is None
    assert entry.solves == 1


def test_the_guess_is_what_happens_without_control(job):
    x = np.array(job.guess["x"])
    assert x.shape == (7, 2)
    assert np.allclose(x, job.ocp.start())
