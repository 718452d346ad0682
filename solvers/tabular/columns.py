"""A CasADi Function at very many points at once, without copies into CasADi's matrices."""

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

# Points that are evaluated in one call.
_CHUNK = 1 << 14


@dataclass(frozen=True, eq=False)
class Columns:
    """A Function whose first inputs differ from point to point; the others are the same for all.

    Attributes:
        function: with dense inputs and one output.
        varying: how many of its inputs differ.
    """

    function: ca.Function
    varying: int
    _maps: dict[int, ca.Function] = field(default_factory=dict, repr=False)

    def __call__(self, rows: list[np.ndarray], common: list[np.ndarray]) -> np.ndarray:
        """Return the output at every point, (n, m).

        (The type stubs of CasADi's buffers do not know that an array brings its own size.)

        Args:
            rows: the inputs that differ, (n, size) each.
            common: the others, (size,) each.
        """
        n, chunk = len(rows[0]), min(_CHUNK, len(rows[0]))
        width = self.function.size1_out(0)
        result, piece = np.empty((n, width)), np.empty((chunk, width))
        if not n or not width:
            return result
        mapped = self._mapped(chunk)
        inputs = [np.zeros((chunk, r.shape[1])) for r in rows]
        inputs += [np.ascontiguousarray(c, dtype=float).reshape(1, -1) for c in common]
        buffer, evaluate = mapped.buffer()
        for i, array in enumerate(inputs):
            if array.size:
                buffer.set_arg(i, array.data)  # pyright: ignore[reportCallIssue]
        buffer.set_res(0, piece.data)  # pyright: ignore[reportCallIssue]
        for start in range(0, n, chunk):
            size = min(chunk, n - start)
            for array, r in zip(inputs, rows, strict=False):
                array[:size] = r[start : start + size]
            evaluate()
            result[start : start + size] = piece[:size]
        return result

    def _mapped(self, chunk: int) -> ca.Function:
        if chunk not in self._maps:
            same = list(range(self.varying, self.function.n_in()))
            self._maps[chunk] = self.function.map("columns", "serial", chunk, same, [])
        return self._maps[chunk]
