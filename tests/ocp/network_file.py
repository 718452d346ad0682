"""A small network in an ONNX file: two inputs, six hidden neurons, one output."""

from pathlib import Path

import casadi as ca
import numpy as np

_RNG = np.random.default_rng(3)
HIDDEN, OUTPUT = _RNG.normal(size=(6, 2)), _RNG.normal(size=(1, 6))


def written(x: np.ndarray) -> np.ndarray:
    """Return the output (1,) for an input (2,)."""
    return OUTPUT @ np.tanh(HIDDEN @ np.asarray(x, dtype=float))


def network_file(path: Path) -> Path:
    """Write the file."""
    x = ca.MX.sym("x", 2)
    output = ca.DM(OUTPUT) @ ca.tanh(ca.DM(HIDDEN) @ x)
    network = ca.Function("drag", [x], [output], ["x"], ["drag"])
    ca.GraphBuilder(network, {}).export_onnx(str(path), {})
    return path
