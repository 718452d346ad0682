"""What one run of a backend returns, with finite numbers only but for the cost."""

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from ocp import Work

#: lbx, ubx, lbg and ubg of a program.
Bounds: TypeAlias = dict[str, np.ndarray]
#: From this on a number counts as not finite.
HUGE = 1e300


@dataclass(frozen=True, eq=False)
class NlpResult:
    """What one run of a backend returned; every number is finite but the cost.

    Attributes:
        w: unknowns, within their bounds.
        cost: inf where the backend met a number that is not finite.
        g: constraints.
        lam_x: multipliers of the bounds.
        lam_g: multipliers of the constraints.
        stats: the backend's statistics.
        is_lost: whether its process ended before it returned.
        residual: of the first-order conditions, where it was judged; None: see the statistics.
    """

    w: np.ndarray
    cost: float
    g: np.ndarray
    lam_x: np.ndarray
    lam_g: np.ndarray
    stats: dict[str, Any]
    is_lost: bool = False
    residual: float | None = None

    @classmethod
    def without_iterate(
        cls, w0: np.ndarray, rows: int, stats: dict[str, Any], *, is_lost: bool = False
    ) -> "NlpResult":
        """Return the first iterate, for a run that has returned none."""
        zeros = np.zeros(rows)
        return cls(w0, np.inf, zeros, np.zeros_like(w0), zeros, stats, is_lost)

    @property
    def success(self) -> bool:
        """Whether the backend reports success."""
        return bool(self.stats.get("success"))

    @property
    def return_status(self) -> str:
        """The backend's own name of how it ended."""
        return str(self.stats.get("return_status", ""))

    @property
    def is_finite(self) -> bool:
        """Whether every number is one that counts as finite."""
        arrays = (self.w, self.g, self.lam_x, self.lam_g)
        return abs(self.cost) < HUGE and all((np.abs(each) < HUGE).all() for each in arrays)

    @property
    def is_undefined(self) -> bool:
        """Whether the backend met a number that is not finite."""
        return not np.isfinite(self.cost) or self.return_status == "Invalid_Number_Detected"

    @property
    def iterations(self) -> int:
        """Number of iterations."""
        return int(self.stats.get("iter_count", 0))

    @property
    def work(self) -> Work:
        """Evaluations and factorisations."""
        calls = [int(self.stats.get(f"n_call_nlp_{name}", 0)) for name in ("g", "jac_g")]
        # Where a backend does not count them there is at least one an iteration.
        factorisations = int(self.stats.get("factorisations", self.iterations))
        return Work(*calls, factorisations=factorisations)

    def history(self, name: str) -> np.ndarray:
        """Return a quantity per iteration; empty where the backend records none."""
        return np.array((self.stats.get("iterations") or {}).get(name, []))
