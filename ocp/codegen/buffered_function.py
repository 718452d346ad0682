"""Functions called with arrays, past CasADi's conversions, which cost more than a stage."""

from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.interrupts import raise_interrupt


@dataclass(frozen=True, eq=False)
class BufferedFunction:
    """A Function with memory of its own for inputs and outputs: arrays in, new arrays out.

    A ``ca.Function`` is what others are built from (symbols in, ``map``, derivatives); where
    numbers go in again and again, a loop or an iteration calls it as ``BufferedFunction``.

    An ordinary call with numpy arrays converts element by element: 0.2 ms for the arrays of 35
    stages that compiled code runs through in 0.04 ms. Of several threads that call it, each waits
    for the one before. ``inputs``, ``outputs`` and ``evaluate`` are for one thread at a time.

    Attributes:
        function: what is called.
    """

    function: ca.Function

    def __call__(self, *inputs: ArrayLike) -> tuple[np.ndarray, ...]:
        """Evaluate; inputs must have the function's sizes, a vector may be (n,)."""
        buffers = self._buffers
        with buffers.lock:
            for place, given in zip(buffers.inputs, inputs, strict=True):
                place.put(given)
            buffers.evaluate()
            return tuple([place.get() for place in buffers.outputs])

    @property
    def inputs(self) -> list[np.ndarray]:
        """The memory of each input: its nonzeros, column by column."""
        return [place.values for place in self._buffers.inputs]

    @property
    def outputs(self) -> list[np.ndarray]:
        """The memory of each output: its nonzeros, column by column."""
        return [place.values for place in self._buffers.outputs]

    def evaluate(self) -> None:
        """Compute the outputs from the inputs, in that memory."""
        self._buffers.evaluate()

    @cached_property
    def _buffers(self) -> "Buffers":
        return Buffers(self.function)


class Buffers:
    """The memory of one function, for one thread at a time: whoever uses it takes the lock.

    Attributes:
        lock: of all that follows.
        inputs: where the inputs are put.
        outputs: where the outputs are got.
    """

    def __init__(self, function: ca.Function) -> None:
        # Any: the type stubs ask for a size that the call does not take.
        self._buffer: Any
        self._buffer, self._run = function.buffer()
        self.lock = Lock()
        self.inputs = [_Place(function.sparsity_in(i)) for i in range(function.n_in())]
        self.outputs = [_Place(function.sparsity_out(i)) for i in range(function.n_out())]
        for i, place in enumerate(self.inputs):
            if place.values.size:
                self._buffer.set_arg(i, place.values.data)
        for i, place in enumerate(self.outputs):
            if place.values.size:
                self._buffer.set_res(i, place.values.data)

    def evaluate(self) -> None:
        """Compute the outputs from the inputs.

        Raises:
            KeyboardInterrupt: after Ctrl-C, or what else a handler of signals raises.
            RuntimeError: where the function does.
        """
        try:
            self._run()
        except (RuntimeError, SystemError) as error:
            raise_interrupt(error)
            raise

    @property
    def failed(self) -> bool:
        """Whether the function said so, without an exception."""
        return bool(self._buffer.ret())

    def stats(self) -> dict[str, Any]:
        """Return the statistics of the last evaluation."""
        return self._buffer.stats()


class _Place:
    """One input or output: its nonzeros, column by column."""

    def __init__(self, sparsity: ca.Sparsity) -> None:
        rows, columns = self._shape = sparsity.shape
        self.values = np.zeros(sparsity.nnz())
        self._where = None if sparsity.is_dense() else np.array(sparsity.find(), dtype=int)
        self._dense = self.values if self._where is None else np.zeros(rows * columns)
        self._matrix = self._dense.reshape(self._shape, order="F")
        # What each shape that may be given is written to: all are the same memory.
        self._views: dict[tuple[int, ...], np.ndarray] = {self._shape: self._matrix}
        if columns == 1:
            self._views[(rows,)] = self._dense
        if rows == columns == 1:
            self._views[()] = self._dense.reshape(())

    def put(self, given: ArrayLike) -> None:
        numbers = np.asarray(given, dtype=float)
        view = self._views.get(numbers.shape)
        if view is None:
            raise ValueError(f"an input has shape {numbers.shape}, {self._shape} is needed")
        view[...] = numbers
        if self._where is not None:
            self.values[:] = self._dense[self._where]

    def get(self) -> np.ndarray:
        if self._where is not None:
            self._dense[self._where] = self.values
        return self._matrix.copy(order="F")
