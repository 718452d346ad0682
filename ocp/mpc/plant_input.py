"""What the plant receives, and within which bounds."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ocp.checks.arguments import check_instance
from ocp.checks.errors import ProblemError
from ocp.codegen.buffered_function import BufferedFunction
from ocp.problem.constraint import Box
from ocp.problem.ocp import OCP

# (x, u, t, p) -> input (m,).
InputMap = Callable[[np.ndarray, np.ndarray, float, np.ndarray], np.ndarray]


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
            ProblemError: if they do not fit, or a discrete-time model is to send a rate.
        """
        if self.what == "control":
            return ocp.control_bounds
        if ocp.model.is_discrete:
            raise ProblemError(f"{ocp.name}: a discrete-time model has no rate to apply")
        return (self.bounds or Box()).sized(ocp.model.nx, f"{ocp.name}: bounds of the rate")

    def limits(self, ocp: OCP) -> tuple[list[float], list[float]]:
        """Return the bounds as numbers, finite where there is none: inf is outside of them."""
        largest, box = np.finfo(float).max, self.box(ocp)
        lower, upper = (np.clip(side, -largest, largest) for side in (box.lower, box.upper))
        return lower.tolist(), upper.tolist()

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
