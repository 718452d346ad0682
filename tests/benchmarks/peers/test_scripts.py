"""What the scripts of the peers work out by themselves; the peers are not needed for it."""

import json
import shutil
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import benchmarks.peers
from benchmarks.peers import PEERS
from benchmarks.peers.conversation import Conversation, PeerFailed
from benchmarks.peers.export import exported
from benchmarks.peers.job import Job, Situation
from models import cart_pole_swing_up

SCRIPTS = Path(benchmarks.peers.__file__).parent / "scripts"
N = 4


@pytest.fixture(scope="module", autouse=True)
def scripts():
    sys.path.insert(0, str(SCRIPTS))
    yield
    sys.path.remove(str(SCRIPTS))


@pytest.fixture(scope="module")
def told():
    ocp = cart_pole_swing_up()
    situations = (Situation(ocp.start()),)
    job = Job(name="c", title="cart-pole", ocp=ocp, intervals=N, situations=situations)
    return json.loads(json.dumps(exported(job, "s")))


@pytest.fixture(scope="module")
def functions(told, tmp_path_factory):
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    compiled, folder = import_module("c_stage").compiled, tmp_path_factory.mktemp("c")
    first = compiled(told["c"], folder)
    kept = list(folder.iterdir())
    compiled(told["c"], folder)
    assert len(kept) == 1
    assert list(folder.iterdir()) == kept, "what is there is not compiled again"
    return first


def point():
    rng = np.random.default_rng(1)
    return rng.normal(size=4), rng.normal(size=(1, N + 1)), np.zeros((N + 1, 1))


def rolled(functions, x0, u, p):
    """States at the nodes, and the cost."""
    x, cost = [x0], 0.0
    for k in range(N):
        after, spent = functions["stage"](x[k], u[:, k], p[k])
        x.append(after[:, 0].copy())
        cost += float(spent[0, 0])
    return np.array(x), cost + float(functions["terminal"](x[-1], p[-1])[0][0, 0])


def differences(value, at):
    """Central differences, the entries of ``at`` along the last axis."""
    columns = []
    for i in range(at.size):
        step = np.zeros(at.size)
        step[i] = 1e-5
        ahead, behind = (value((at.ravel() + s).reshape(at.shape)) for s in (step, -step))
        columns.append((np.asarray(ahead) - np.asarray(behind)) / 2e-5)
    return np.stack(columns, axis=-1)


def test_slopes_over_all_controls_are_those_of_the_roll_out(functions):
    x0, u, p = point()
    run = import_module("slopes").RollOut(functions)
    want = differences(lambda v: rolled(functions, x0, v, p)[1], u)
    assert np.allclose(run.gradient(x0, u, p).ravel(), want, rtol=1e-6, atol=1e-8)
    want = differences(lambda v: rolled(functions, x0, v, p)[0], u)
    found = run.sensitivities(x0, u, p)
    assert np.allclose(found.reshape(N + 1, 4, -1), want, rtol=1e-6, atol=1e-8)
    # The state that is given does not move, and the control of the end moves nothing.
    assert not found[0].any()
    assert not found[..., -1].any()


def test_the_bend_of_a_stage_is_the_second_derivative_of_the_weighted_state(functions):
    x0, u, p = point()
    weights, z = np.array([1.0, -2.0, 0.5, 3.0]), np.append(x0, u[:, 0])

    def slope(at: np.ndarray) -> np.ndarray:
        on_x, on_u, *_ = functions["stage_slopes"](at[:4], at[4:], p[0])
        return np.concatenate([weights @ on_x, weights @ on_u])

    want = differences(slope, z)
    xx, xu, uu = (b.copy() for b in functions["stage_bend"](z[:4], z[4:], p[0], weights))
    assert np.allclose(np.block([[xx, xu], [xu.T, uu]]), want, rtol=1e-6, atol=1e-7)


# Rounded: of entries whose squares underflow LAPACK's eigenvalues are wrong in the second digit.
entries = arrays(float, (3, 3), elements=st.floats(-10.0, 10.0).map(lambda v: round(v, 6)))


@given(entries)
def test_a_projection_keeps_what_is_convex_and_lifts_the_rest(matrix):
    projected = import_module("slopes").projected
    convex = matrix @ matrix.T + np.eye(3)
    assert np.allclose(projected(convex), convex, rtol=1e-9, atol=1e-9)
    found = projected(matrix + matrix.T)
    assert np.linalg.eigvalsh(found).min() > 0.0
    # The nearest one: what was taken away is the negative part alone.
    values = np.linalg.eigvalsh(matrix + matrix.T)
    taken = np.linalg.norm(found - matrix - matrix.T)
    assert taken == pytest.approx(np.linalg.norm(np.minimum(values - 1e-6, 0.0)), abs=1e-7)


def test_bounds_along_the_horizon_leave_the_given_state_free_and_prescribe_the_end(told):
    along = import_module("wire").bounds_along(told)
    assert [len(lower) for lower, _ in along] == [5] * N + [4]
    first, second, last = along[0], along[1], along[-1]
    assert np.isinf(first[0][:4]).all()
    assert first[0][4] == -20.0
    assert (second[0][0], second[1][0]) == (-2.0, 2.0)
    assert np.array_equal(last[0], [1.0, np.pi, 0.0, 0.0])
    assert np.array_equal(last[1], last[0])


def test_a_tape_says_whether_it_reads_time_and_parameters(told):
    reads_parameters = import_module("replay").reads_parameters
    assert not reads_parameters(told["stage"])
    moving = {"inputs": [4, 1, 1], "code": [["input", 0, [2, 0]]]}
    assert reads_parameters(moving)


@pytest.mark.parametrize("peer", PEERS, ids=lambda peer: peer.name)
def test_every_peer_has_its_script_and_exact_requirements(peer):
    text = (peer.folder / peer.script).read_text(encoding="utf-8")
    assert "serve(" in text
    assert "benchmarks" not in text, "a script imports nothing of ours"
    assert len(set(peer.settings)) == len(peer.settings)
    assert (peer.name == "scipy") == (not peer.wanted)


@pytest.mark.parametrize("name", ["control", "ssqp", "nmpyc"])
def test_a_peer_without_its_package_ends_with_what_is_missing(name):
    """Its script in our environment, where the package is not."""
    peer = next(peer for peer in PEERS if peer.name == name)
    command = [sys.executable, "-E", "-s", str(peer.folder / peer.script)]
    missing = "ended with code 1.*ModuleNotFoundError: No module named"
    with Conversation(command) as alone, pytest.raises(PeerFailed, match=missing):
        alone.ask({"do": "build", "job": {}}, limit=30.0)
