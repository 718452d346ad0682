"""Plays a list of elementary operations again: with symbols of any CasADi, or with arrays.

Every peer that takes expressions gets the same ones in this way, whatever its CasADi is.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

_IN_NUMPY: dict[str, Callable] = {
    "if_else_zero": lambda condition, value: np.where(condition, value, 0.0),
    "not": np.logical_not,
    "and": np.logical_and,
    "or": np.logical_or,
}


def _in_casadi(casadi: Any) -> dict[str, Callable]:
    return {
        "if_else_zero": lambda condition, value: casadi.if_else(condition, value, 0.0),
        "not": casadi.logic_not,
        "and": casadi.logic_and,
        "or": casadi.logic_or,
    }


def _operations(library: Any, own: dict[str, Callable]) -> dict[str, Callable]:
    plain: dict[str, Callable] = {
        "add": lambda a, b: a + b,
        "sub": lambda a, b: a - b,
        "mul": lambda a, b: a * b,
        "div": lambda a, b: a / b,
        "neg": lambda a: -a,
        "sq": lambda a: a * a,
        "twice": lambda a: a + a,
        "inv": lambda a: 1.0 / a,
        "pow": lambda a, b: a**b,
        "constpow": lambda a, b: a**b,
        "lt": lambda a, b: a < b,
        "le": lambda a, b: a <= b,
        "assign": lambda a: a,
    }
    same = ("sin", "cos", "tan", "sqrt", "exp", "log", "fmin", "fmax", "fabs", "tanh", "sign")
    return plain | own | {name: getattr(library, name) for name in same}


def with_casadi(tape: dict, inputs: Sequence[Any], casadi: Any) -> list[Any]:
    """Return the outputs as columns of expressions; ``inputs`` are SX or MX columns."""
    operations = _operations(casadi, _in_casadi(casadi))
    return [casadi.vertcat(*rows) for rows in _replay(tape, inputs, operations)]


def with_numpy(tape: dict, inputs: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the outputs (size, ...); ``inputs`` are (size, ...), all entries alike in shape."""
    operations = _operations(np, _IN_NUMPY)
    return [
        np.array(np.broadcast_arrays(*rows)) if rows else np.zeros(0)
        for rows in _replay(tape, inputs, operations)
    ]


def _replay(tape: dict, inputs: Sequence[Any], operations: dict[str, Callable]) -> list[list]:
    registers: list[Any] = [None] * tape["registers"]
    outputs: list[list[Any]] = [[0.0] * size for size in tape["outputs"]]
    for name, target, arguments in tape["code"]:
        if name == "input":
            registers[target] = inputs[arguments[0]][arguments[1]]
        elif name == "const":
            registers[target] = arguments[0]
        elif name == "output":
            outputs[target[0]][target[1]] = registers[arguments[0]]
        else:
            registers[target] = operations[name](*[registers[a] for a in arguments])
    return outputs


def function(tape: dict, casadi: Any) -> Any:
    """Return it as a Function of scalars, which can be called with MX or numbers."""
    inputs = [casadi.SX.sym(f"i{k}", size) for k, size in enumerate(tape["inputs"])]
    return casadi.Function("replayed", inputs, with_casadi(tape, inputs, casadi))


def reads_parameters(tape: dict) -> bool:
    """Return whether a tape reads its last argument: time and parameters."""
    last = len(tape["inputs"]) - 1
    return any(name == "input" and given[0] == last for name, _, given in tape["code"])
