"""``BufferedNlp``: a ``casadi.nlpsol`` called with arrays."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.codegen.buffered_function import Buffers

#: Of every ``nlpsol``: CasADi prints a warning where multipliers of the parameters, which nobody
#: asks for here, are not finite, and no other option turns that off.
QUIET = {
    "calc_lam_p": False,
    "error_on_fail": False,
    "print_time": False,
    "show_eval_warnings": False,
}


@dataclass(frozen=True, eq=False)
class BufferedNlp:
    """A nonlinear program with memory of its own: arrays in, new arrays and statistics out.

    Of several threads that call it, each waits for the one before. By an ordinary call Ctrl-C
    ends IPOPT, and is forgotten.

    Attributes:
        function: the ``casadi.nlpsol``.
    """

    function: ca.Function

    def __call__(
        self, inputs: Mapping[str, ArrayLike]
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Return outputs and statistics.

        Args:
            inputs: x0, p, lbx, ubx, lbg, ubg, all of them; multipliers start at 0.

        Raises:
            KeyboardInterrupt: after Ctrl-C.
            RuntimeError: where the backend throws.
        """
        buffers = self._buffers
        with buffers.lock:
            for name, given in inputs.items():
                buffers.inputs[self.function.index_in(name)].put(given)
            buffers.evaluate()
            if buffers.failed:
                raise RuntimeError(f"{self.function.name()} has failed")
            outputs = zip(self.function.name_out(), buffers.outputs, strict=True)
            return {name: place.get().ravel() for name, place in outputs}, buffers.stats()

    @cached_property
    def _buffers(self) -> Buffers:
        return Buffers(self.function)
