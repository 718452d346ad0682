"""A CasADi Function as a list of elementary operations, which needs no CasADi to be read.

Peers bring CasADi in other versions, or none. Serialised Functions are not promised to be read
by another version; a list of operations is read by anything (``scripts/replay.py``).
"""

from typing import Any

import casadi as ca

_NAMES: dict[int, str] = {
    value: name.removeprefix("OP_").lower()
    for name, value in vars(ca).items()
    if name.startswith("OP_")
}


def tape_of(function: ca.Function) -> dict[str, Any]:
    """Return what a function of scalars (an SX Function) computes, operation by operation.

    Returns:
        ``inputs`` and ``outputs``: their sizes; ``registers``: how many numbers are kept;
        ``code``: [operation, target, arguments], where an input is [argument, entry], a
        constant its value, the target of an output [output, entry], all else a register.
    """
    x = function.sx_in()
    # Any: SX and MX, which the type stubs keep apart.
    outputs: Any = [ca.densify(y) for y in function.call(x, True, False)]
    f = ca.Function(function.name(), x, outputs)
    return {
        "inputs": [f.numel_in(i) for i in range(f.n_in())],
        "outputs": [f.numel_out(i) for i in range(f.n_out())],
        "registers": f.sz_w(),
        "code": [_instruction(f, k) for k in range(f.n_instructions())],
    }


def _instruction(f: ca.Function, k: int) -> list:
    name, given, target = (
        _NAMES[f.instruction_id(k)],
        f.instruction_input(k),
        f.instruction_output(k),
    )
    if name == "const":
        return [name, target[0], [f.instruction_constant(k)]]
    return [name, target if name == "output" else target[0], given]
