"""A control that acts later than it is sent."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_numbers, check_whole
from ocp.checks.errors import ProblemError, UnsupportedProblem
from ocp.checks.expressions import check_symbols
from ocp.problem.model import Model
from ocp.problem.parameters import PastInput
from ocp.problem.portable import Portable


@dataclass(frozen=True, eq=False)
class Delay(Portable):
    r"""A control of a discrete-time model that acts some steps after it is sent.

    .. math:: x_{k+1} = f(x_k, u_{k-d}, t_k)

    The dynamics have what was sent d steps before; costs, bounds and constraints have what is sent.

    Args:
        control: one of the model's controls.
        steps: d, at least 1.
        history: what was sent before the start, the oldest first, a number or (d,); another one is
            a run argument, ``run(parameters={"history of <control>": ...})``.

    Raises:
        ProblemError: if it is no single symbol, or steps and history do not fit.
    """

    control: ca.SX
    steps: int
    history: ArrayLike = 0.0

    def __post_init__(self) -> None:
        """Check symbol, steps and history."""
        check_symbols(self.control, "Delay: control")
        if self.control.numel() != 1:
            raise ProblemError(
                f"Delay: control has {self.control.numel()} entries; give each a Delay of its own"
            )
        check_whole(self.steps, f"Delay of {self.control}: steps")
        history = check_numbers(self.history, self.steps, f"Delay of {self.control}: history")
        object.__setattr__(self, "history", history)

    @property
    def name(self) -> str:
        """The run argument that is its history."""
        return f"history of {self.control}"

    def entry(self) -> PastInput:
        """Return the history as an entry of a run, with new symbols (d,)."""
        past = [ca.SX.sym(f"{self.control}[-{self.steps - k}]") for k in range(self.steps)]
        return PastInput(ca.vertcat(*past), np.asarray(self.history), self.name)

    def index(self, model: Model) -> int:
        """Return which control it is."""
        hashes = [e.element_hash() for e in ca.vertsplit(model.u)]
        return hashes.index(self.control.element_hash())

    def per(self, size: float) -> "Delay":
        """Return the same for a control measured in a size."""
        return replace(self, history=np.asarray(self.history) / size)


def check_delays(owner: str, model: Model, delays: Iterable[Delay]) -> None:
    """Refuse delays in continuous time, of what is no control, and two of one control."""
    controls, seen = [e.element_hash() for e in ca.vertsplit(model.u)], set[int]()
    for delay in delays:
        if not model.is_discrete:
            raise UnsupportedProblem(
                f"{owner}: a Delay of '{delay.control}' counts steps, and the model is continuous "
                "in time: make it discrete, discretise(ocp, dt); a loop has MPC(delay=...)"
            )
        symbol = delay.control.element_hash()
        if symbol not in controls:
            raise ProblemError(
                f"{owner}: a Delay of '{delay.control}', which is no control; they are "
                f"{', '.join(model.u_names) or 'none'}"
            )
        if symbol in seen:
            raise ProblemError(f"{owner}: two delays of '{delay.control}'")
        seen.add(symbol)
