"""Networks from ONNX files: the same numbers as what was written, exact derivatives, bad files."""

import pickle
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from ocp import DamagedFile, Network, ProblemError
from tests.ocp.differences import gradient
from tests.ocp.network_file import network_file, written
from tests.tolerances import DERIVATIVE, ROUNDING


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return network_file(tmp_path_factory.mktemp("network") / "drag.onnx")


def test_its_numbers_are_those_of_the_weights(path: Path) -> None:
    network = Network(path)
    for point in np.random.default_rng(0).normal(size=(5, 2)):
        np.testing.assert_allclose(network(point), written(point), rtol=ROUNDING)
    assert network.sizes == (2,)


def test_its_derivatives_agree_with_differences(path: Path) -> None:
    network, x = Network(str(path)), ca.SX.sym("x", 2)
    slope = ca.Function("slope", [x], [ca.gradient(network(x), x)])
    expected = gradient(lambda v: float(written(v)[0]), np.array([0.3, -0.2]))
    np.testing.assert_allclose(np.array(slope([0.3, -0.2]))[:, 0], expected, atol=DERIVATIVE)


def test_it_is_written_out_and_copied(path: Path) -> None:
    network, x = Network(path), ca.SX.sym("x", 2)
    assert not ca.Function("f", [x], [network(x)]).find_functions()
    assert network(ca.MX.sym("x", 2)).shape == (1, 1)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(network))([1, 2]), network([1, 2]))


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=r"network: there is no file .*none\.onnx"):
        Network(tmp_path / "none.onnx")
    with pytest.raises(ProblemError, match="the file is a float"):
        Network(1.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("content", [b"", b"hello", None])
def test_a_file_that_is_damaged(path: Path, tmp_path: Path, content: bytes | None) -> None:
    damaged = tmp_path / "damaged.onnx"
    damaged.write_bytes(path.read_bytes()[:200] if content is None else content)
    with pytest.raises(DamagedFile, match=r"network .*damaged\.onnx"):
        Network(damaged)


def test_an_operation_that_is_not_known(path: Path, tmp_path: Path) -> None:
    strange = tmp_path / "strange.onnx"
    strange.write_bytes(path.read_bytes().replace(b"Tanh", b"Zanh"))
    with pytest.raises(ProblemError, match=r"strange\.onnx.*Zanh"):
        Network(strange)


@pytest.mark.parametrize(
    ("inputs", "words"),
    [
        ((ca.SX.sym("x", 3),), r"drag\.onnx: input 'x' has 3 entries, 2 are needed"),
        (([1.0],), "input 'x' has 1 entries"),
        (([1.0, 2.0], [1.0]), "it takes 1 inputs, not 2"),
        (("ab",), "input 'x' is not numeric"),
    ],
)
def test_refuses_inputs(path: Path, inputs: tuple[Any, ...], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        Network(path)(*inputs)


def test_says_which_outputs_there_are(path: Path, tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="no output 'lift'; it has drag"):
        Network(path, output="lift")
    x = ca.MX.sym("x", 2)
    two = ca.Function("two", [x], [ca.sin(x), ca.cos(x)], ["x"], ["s", "c"])
    ca.GraphBuilder(two, {}).export_onnx(str(tmp_path / "two.onnx"), {})
    with pytest.raises(ProblemError, match="outputs s, c; say which"):
        Network(tmp_path / "two.onnx")
    np.testing.assert_allclose(Network(tmp_path / "two.onnx", output="c")([0, 1]), np.cos([0, 1]))
