"""What of a solution is drawn: by structure, since ``Solution`` is built on this room."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData


class Outcome(Protocol):
    """How a solve ended; see ``Status``."""

    @property
    def words(self) -> str:
        """In a few plain words."""
        ...

    @property
    def is_success(self) -> bool:
        """Whether it found something."""
        ...


class PlottableSolution(Protocol):
    """What of a ``Solution`` is drawn."""

    @property
    def problem(self) -> OCP:
        """The problem."""
        ...

    @property
    def t(self) -> np.ndarray:
        """Nodes [s], (N + 1,)."""
        ...

    @property
    def control_kind(self) -> str:
        """What controls are between the nodes."""
        ...

    @property
    def duration(self) -> float:
        """[s]."""
        ...

    @property
    def data(self) -> RunData:
        """The numbers of the run."""
        ...

    def state(self, t: ArrayLike) -> np.ndarray:
        """States at time(s) t [s]."""
        ...

    def control(self, t: ArrayLike) -> np.ndarray:
        """Controls at time(s) t [s]."""
        ...

    def costate_at(self, t: ArrayLike) -> np.ndarray:
        """Costates at time(s) t [s]."""
        ...


@dataclass(frozen=True, eq=False)
class Pictured:
    """What a picture says of a solution, with its phases.

    Attributes:
        name: of the problem.
        status: how the solve ended.
        message: what and where, where the status alone does not say it.
        cost: the solver's own.
        unknowns: values of the unknown constants, by name.
        phases: the solution of each, on its own part of one clock; one without phases is the
            only one.
        names: of the phases.
    """

    name: str
    status: Outcome
    message: str
    cost: float
    unknowns: Mapping[str, np.ndarray]
    phases: Sequence[PlottableSolution]
    names: Sequence[str]
