"""A CasADi Function at all nodes at once, on arrays as they are."""

from typing import Any

import casadi as ca
import numpy as np


class NodeFunction:
    """One column f(t, p) at several nodes; nothing is converted, which would take longer.

    Args:
        function: (t, p) -> a dense column (rows,).
        count: number of nodes.
    """

    def __init__(self, function: ca.Function, count: int) -> None:
        """Compile, and open the Function's own memory."""
        self._function = function.map(count)
        self._shape = count, function.numel_out(0)
        # Its stub asks for an argument too many.
        buffer: Any = self._function.buffer()
        self._buffer, self._evaluate = buffer

    def __call__(self, t: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the values (count, rows) at times (count,) with parameters (count, n_p)."""
        values = np.empty(self._shape)
        inputs = [np.ascontiguousarray(given, dtype=float) for given in (t, p)]
        for i, given in enumerate(inputs):
            if given.size:
                self._buffer.set_arg(i, given.data)
        if values.size:
            self._buffer.set_res(0, values.data)
            self._evaluate()
        return values
