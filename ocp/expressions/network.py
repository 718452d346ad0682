"""A neural network that was trained elsewhere, read from an ONNX file."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from ocp.checks.arguments import check_instance, check_numeric
from ocp.checks.errors import DamagedFile, ProblemError


@dataclass(frozen=True, eq=False)
class Network:
    """A network as an expression: ``Network("drag.onnx")(ca.vertcat(mach, height))``.

    The file is read once, with CasADi's own reader; nothing else need be installed. Its operations
    are written out like a formula's, so that every method takes them and derivatives are exact.
    Where an activation has a kink (Relu), the problem has one.

    Args:
        file: path of an ONNX file; of a batch, whose size it leaves open, the network takes one.
        output: which output is meant, where the file has several.

    Attributes:
        function: (inputs) -> output, each a column of its entries.

    Raises:
        ProblemError: if there is no such file or output, or the file has an operation that is
            not known.
        DamagedFile: if it is no ONNX file, or not a whole one.
    """

    file: str | Path
    output: str | None = None
    function: ca.Function = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Read the file."""
        check_instance(self.file, (str, Path), "network: the file")
        path = Path(self.file)
        if not path.is_file():
            raise ProblemError(f"network: there is no file {path}")
        object.__setattr__(self, "function", _read(path, self.output))

    @property
    def sizes(self) -> tuple[int, ...]:
        """How many numbers each input takes."""
        return tuple(self.function.numel_in(i) for i in range(self.function.n_in()))

    def __call__(self, *inputs: Any) -> Any:
        """Return the output (m,) of inputs: expressions, or numbers alone.

        Raises:
            ProblemError: for another number of inputs, or one of another size.
        """
        if len(inputs) != len(self.sizes):
            raise ProblemError(f"{self}: it takes {len(self.sizes)} inputs, not {len(inputs)}")
        kind = next((type(each) for each in inputs if isinstance(each, ca.SX | ca.MX)), None)
        columns: list[Any] = []
        for given, name, size in zip(inputs, self.function.name_in(), self.sizes, strict=True):
            what = f"{self}: input '{name}'"
            column = kind(given) if kind else ca.DM(check_numeric(given, what).reshape(-1))
            if column.numel() != size:
                raise ProblemError(f"{what} has {column.numel()} entries, {size} are needed")
            columns.append(ca.vec(column))
        found: Any = self.function.call(columns)[0]
        return ca.vec(found) if kind else np.array(found).reshape(-1)

    def __repr__(self) -> str:
        """Return one line: its file, and how many numbers it takes."""
        return f"<Network {Path(self.file).name}: inputs of {self.sizes}>"

    def __str__(self) -> str:
        """Return what messages call it."""
        return f"network {Path(self.file).name}"


def _read(path: Path, output: str | None) -> ca.Function:
    """Return the network of a file as a Function of columns."""
    if not path.stat().st_size:
        raise DamagedFile(f"network {path}: the file is empty")
    try:
        graph = ca.GraphBuilder(str(path), {})
    except RuntimeError as error:
        raise DamagedFile(
            f"network {path}: no ONNX file that can be read ({_said(error)})"
        ) from error
    if output is None and graph.n_out() > 1:
        raise ProblemError(
            f"network {path}: it has the outputs {', '.join(graph.name_out())}; say which: "
            "Network(file, output=...)"
        )
    name = graph.name_out()[0] if output is None else output
    if name not in graph.name_out():
        known = ", ".join(graph.name_out())
        raise ProblemError(f"network {path}: it has no output '{name}'; it has {known}")
    for size in graph.dynamic_params():
        graph.bind_dim(size, 1)
    try:
        function = graph.create("network", {"symbolic": True})
    except RuntimeError as error:
        raise ProblemError(
            f"network {path}: it cannot be written as an expression: {_said(error)}; export it "
            "with simpler operations"
        ) from error
    return _expanded(function, name)


def _expanded(function: ca.Function, output: str) -> ca.Function:
    """Return one output of a Function, written out where every operation has a scalar form."""
    inputs, names = function.mx_in(), (function.name_in(), [output])
    outputs = [function.call(inputs)[function.index_out(output)]]
    try:
        return ca.Function("network", inputs, outputs, *names).expand()
    except RuntimeError:  # the network is called as it is
        return ca.Function("network", inputs, outputs, *names, {"never_inline": True})


def _said(error: RuntimeError) -> str:
    """Return what CasADi says, without the place in its source."""
    return str(error).strip().splitlines()[-1].split(": ", 1)[-1]
