"""How the phases of a direct method have ended, and where else it may start."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ocp import Status, Work
from solvers.direct.nlp_result import NlpResult


class OtherStart(NamedTuple):
    """Another first iterate.

    Attributes:
        words: what it is, for messages.
        duration: its final time minus t0, where that was changed [s].
        make: returns the unknowns.
    """

    words: str
    duration: float | None
    make: Callable[[], np.ndarray]


@dataclass(frozen=True, eq=False)
class NlpOutcome:
    """How the phases so far have ended.

    Attributes:
        results: of every run of a backend; the last one is returned to the user.
        status: how it ended.
        message: what went wrong, and when on the horizon.
    """

    results: tuple[NlpResult, ...]
    status: Status
    message: str

    @property
    def last(self) -> NlpResult:
        """The result that counts."""
        return self.results[-1]

    @property
    def iterations(self) -> int:
        """Iterations of all runs."""
        return sum(result.iterations for result in self.results)

    @property
    def work(self) -> Work:
        """Work of all runs."""
        return sum((result.work for result in self.results), Work())

    def history(self) -> dict[str, np.ndarray]:
        """Return cost, infeasibility and residual of each iteration of the last run."""
        names = {"cost": "obj", "infeasibility": "inf_pr", "residual": "inf_du"}
        return {name: self.last.history(own) for name, own in names.items()}

    @property
    def residual(self) -> float:
        """The last dual infeasibility, or that which was accepted; 0 where none is recorded."""
        if self.last.residual is not None:
            return self.last.residual
        values = self.last.history("inf_du")
        return float(values[-1]) if values.size else 0.0

    @property
    def is_undefined(self) -> bool:
        """Whether a backend met a number that is not finite."""
        return any(result.is_undefined for result in self.results)

    def told_by(self, words: str) -> "NlpOutcome":
        """Return this outcome with something more in its message."""
        return replace(self, message=f"{self.message}; {words}" if self.message else words)

    def after(self, earlier: "NlpOutcome") -> "NlpOutcome":
        """Return this outcome with the work of an earlier one."""
        return replace(self, results=(*earlier.results, *self.results))
