"""One step repeated very often, for trajectories whose length is not known beforehand."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

# Chains of powers of two up to this are built once; longer ones only cost memory.
_LONGEST = 128


@dataclass(frozen=True, eq=False)
class ChunkedRollout:
    """A Function applied again and again, its first outputs fed back as its first inputs.

    Building a chain of n steps takes longer than running it, so a march of any length is
    put together from a few chains that are built once.

    Attributes:
        step: the Function.
        carried: how many of its inputs are fed by its outputs.
    """

    step: ca.Function
    carried: int = 1

    def __call__(
        self, start: Sequence[np.ndarray], inputs: Sequence[np.ndarray]
    ) -> list[np.ndarray]:
        """Return every output after each of K steps, (K, m) each.

        Args:
            start: the carried inputs before the first step, (m,) each.
            inputs: the other inputs at every step, (K, m) each.
        """
        total = len(inputs[0])
        columns = [ca.DM(array.T) for array in inputs]
        carried, pieces, done = list(start), [], 0
        while done < total:
            size = min(_LONGEST, 1 << (total - done).bit_length() - 1)
            here = [c[:, done : done + size] for c in columns]
            outputs = self._chain(size)(*carried, *here)
            carried = [outputs[i][:, -1] for i in range(self.carried)]
            pieces.append(outputs)
            done += size
        return [np.hstack([np.array(p[i]) for p in pieces]).T for i in range(self.step.n_out())]

    @cached_property
    def _chains(self) -> dict[int, ca.Function]:
        return {}

    def _chain(self, size: int) -> ca.Function:
        if size not in self._chains:
            name = f"{self.step.name()}_{size}"
            self._chains[size] = self.step.mapaccum(name, size, self.carried)
        return self._chains[size]
