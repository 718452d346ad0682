"""A drag that is not written as a formula: of a library, or of Python."""

import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np


def drag(v: Any) -> Any:
    """Return what the others give."""
    return 0.3 * v * ca.sqrt(1 + v**2)


def library(folder: Path, *, order: int = 2) -> ca.Function:
    """Return it from a library, with its derivatives up to an order."""
    v = ca.SX.sym("v")
    function = ca.Function("drag", [v], [drag(v)])
    generator = ca.CodeGenerator(f"drag_of_order_{order}")
    generator.add(function)
    slope = function.reverse(1)
    for each in [[], [function.forward(1), slope], [slope.forward(1)]][: order + 1]:
        for derivative in each:
            generator.add(derivative)
    source = folder / f"drag_of_order_{order}.c"
    source.write_text(generator.dump(), encoding="utf-8")
    built = folder / f"drag_of_order_{order}.so"
    subprocess.run(["cc", "-O1", "-shared", "-fPIC", str(source), "-o", str(built)], check=True)
    return ca.external("drag", str(built))


class Python(ca.Callback):
    """It in Python, differentiated by finite differences, or not at all."""

    def __init__(self, *, differences: bool = True) -> None:
        """Make it a function of CasADi."""
        ca.Callback.__init__(self)
        self.construct("drag", {"enable_fd": differences})

    def get_n_in(self) -> int:
        """One input."""
        return 1

    def get_n_out(self) -> int:
        """One output."""
        return 1

    def eval(self, arg: Sequence[Any]) -> list[Any]:
        """Evaluate it."""
        v = float(arg[0])
        return [0.3 * v * np.sqrt(1 + v**2)]
