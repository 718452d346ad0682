"""What the plant receives, and within which bounds."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from ocp.checks.arguments import check_instance
from ocp.checks.errors import ProblemError
from ocp.codegen.buffered_function import BufferedFunction
from ocp.problem.constraint import Box
from ocp.problem.ocp import OCP

# (x, u, t, p) -> input (m,).
InputMap = Callable[[np.ndarray, np.ndarray, float, np.ndarray], np.ndarray]


class InputBounds(NamedTuple):
    """The bounds of an input, and the same as plain numbers.

    Attributes:
        box: the bounds, each (m,).
        lower: as numbers, finite where there is none: an infinite input is outside.
        upper: likewise.
    """

    box: Box
    lower: list[float]
    upper: list[float]

    @classmethod
    def of(cls, box: Box) -> "InputBounds":
        """Return the bounds of a box of a given size."""
        largest = np.finfo(float).max
        lower, upper = (np.clip(side, -largest, largest) for side in (box.lower, box.upper))
        return cls(box, lower.tolist(), upper.tolist())

    def clip(self, given: np.ndarray) -> tuple[np.ndarray, float]:
        """Return an input within the bounds, and by how much it was moved: NaN or inf for such."""
        # Nearly all inputs need no clipping, and plain numbers say so sooner than numpy does.
        each = zip(given.tolist(), self.lower, self.upper, strict=True)
        if all([low <= value <= high for value, low, high in each]):
            return given.copy(), 0.0
        inside = self.box.clip(given)
        return inside, float(np.abs(given - inside).max())


@dataclass(frozen=True)
class PlantInput:
    """The quantity that is sent to the plant.

    Args:
        what: ``"control"``: u of the problem; ``"rate"``: dx/dt = f(x, u, t), which is what a
            kinematically controlled robot takes: its joint velocities (Algorithm 3).
        bounds: of a rate; those of a control are the problem's.
    """

    what: Literal["control", "rate"] = "control"
    bounds: Box | None = None

    def __post_init__(self) -> None:
        """Check the choice."""
        if self.what not in ("control", "rate"):
            raise ProblemError(f"applied: {self.what!r} is neither control nor rate")
        if self.bounds is not None:
            check_instance(self.bounds, Box, "applied: bounds")
        if self.what == "control" and self.bounds is not None:
            raise ProblemError("applied: the bounds of a control are those of the problem")

    def size(self, ocp: OCP) -> int:
        """Return the number of inputs."""
        return ocp.model.nu if self.what == "control" else ocp.model.nx

    def box(self, ocp: OCP) -> Box:
        """Return the bounds of the input, each (m,).

        Raises:
            ProblemError: if they do not fit, or a rate is asked of a discrete-time model.
        """
        if self.what == "control":
            return ocp.control_bounds
        if ocp.model.is_discrete:
            raise ProblemError(f"{ocp.name}: a discrete-time model has no rate to apply")
        return (self.bounds or Box()).sized(ocp.model.nx, f"{ocp.name}: bounds of the rate")

    def sending(self, ocp: OCP) -> InputMap:
        """Return what makes an input of a state and a control of the problem."""
        if self.what == "control":
            return lambda x, u, t, p: u
        function = BufferedFunction(ocp.functions.rate)
        # Straight into its memory: after a solve this is half as long as a call, see
        # docs/compile.md.
        (x_in, u_in, t_in, p_in), (rate,) = function.inputs, function.outputs

        def sent(x: np.ndarray, u: np.ndarray, t: float, p: np.ndarray) -> np.ndarray:
            x_in[:], u_in[:], t_in[:], p_in[:] = x, u, t, p
            function.evaluate()
            return rate.copy()

        return sent
