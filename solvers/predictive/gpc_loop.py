"""A plant under generalised predictive control, with noise and a load."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ocp import ProblemError, Status
from ocp.internal import check_instance, check_whole
from solvers.predictive.carima_prediction import history
from solvers.predictive.gpc import GPCLaw


@runtime_checkable
class OutputPlant(Protocol):
    """Something with one input and one output: ``models.CarimaPlant``."""

    def measure(self, noise: float = 0.0) -> float:
        """Return the output at time 0."""
        ...

    def advance(self, u: float, noise: float = 0.0) -> float:
        """Apply an input for one step and return the output at its end."""
        ...


@dataclass(frozen=True, eq=False)
class GPCRun:
    """A closed loop of T steps.

    Attributes:
        y: outputs, (T + 1,).
        u: inputs, (T,).
        du: their increments, (T,).
        reference: w(0) ... w(T), (T + 1,).
        weight: lambda.
        statuses: how each step ended, (T,).
        message: of the first step that failed.
    """

    y: np.ndarray
    u: np.ndarray
    du: np.ndarray
    reference: np.ndarray
    weight: float
    statuses: tuple[Status, ...]
    message: str = ""

    @property
    def cost(self) -> float:
        """Sum of (y - w)^2 over times 1 ... T, and of lambda du^2: the cost of Fig. 2.9."""
        return float(np.sum((self.y - self.reference)[1:] ** 2) + self.weight * self.du @ self.du)


def gpc_loop(
    law: GPCLaw,
    plant: OutputPlant,
    reference: ArrayLike,
    steps: int,
    *,
    noise: ArrayLike | None = None,
    load: ArrayLike | None = None,
    preview: bool = True,
) -> GPCRun:
    """Run the law on a plant that rests at input 0.

    Args:
        law: the controller.
        plant: at rest; it need not be the model of the law.
        reference: w(0), w(1), ..., at least ``steps`` + N2 numbers, or one for all times.
        steps: T.
        noise: e(0) ... e(T) of the plant, default 0.
        load: disturbance added to the input, (T,), unknown to the law, default 0.
        preview: whether the law sees the reference ahead; else it takes w(t + 1) for all.

    Raises:
        ProblemError: if the reference, the noise or the load is too short.
    """
    check_instance(law, GPCLaw, "GPC loop: law")
    check_instance(plant, OutputPlant, "GPC loop: plant")
    check_whole(steps, "GPC loop: steps")
    n2 = law.prediction.n2
    w = history(reference, "reference")
    w = np.full(steps + n2, w[0]) if w.size == 1 else w
    e = np.zeros(steps + 1) if noise is None else history(noise, "noise")
    v = np.zeros(steps) if load is None else history(load, "load")
    for what, array, needed in (
        ("reference", w, steps + n2),
        ("noise", e, steps + 1),
        ("load", v, steps),
    ):
        if len(array) < needed:
            raise ProblemError(f"GPC loop: {what} has {len(array)} entries, {needed} are needed")
    y, u, statuses, message = [plant.measure(e[0])], [0.0], [], ""
    for t in range(steps):
        ahead = w[t + 1 : t + 1 + n2] if preview else w[t + 1]
        move = law.step(y, u, ahead)
        statuses.append(move.status)
        message = message or (f"step {t}: {move.message}" if move.message else "")
        u.append(u[-1] + move.increment)
        y.append(plant.advance(u[-1] + v[t], e[t + 1]))
    return GPCRun(
        y=np.array(y),
        u=np.array(u[1:]),
        du=np.diff(u),
        reference=w[: steps + 1],
        weight=law.options.weight,
        statuses=tuple(statuses),
        message=message,
    )
