"""What a controller decides at one step, and where the input comes from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol, runtime_checkable

import numpy as np

from ocp.checks.errors import OCPError
from ocp.checks.rich_text import html_of
from ocp.solution.solution import Solution
from ocp.solution.status import Status


class InputSource(Enum):
    """Which rung of the ladder the input comes from, best first."""

    OPTIMAL = "the first control of a plan that meets the optimality conditions"
    REAL_TIME = "the first control of a plan for the expected state, corrected by the measured one"
    FEASIBLE = "the first control of a new plan that meets the constraints, but is not optimal"
    SHIFTED = "the next control of an earlier plan whose remainder still meets the constraints"
    LEAST_VIOLATING = "the first control of the plan that violates the constraints least"
    BACKUP = "the backup law's, since no plan can be used"

    @property
    def is_planned(self) -> bool:
        """Whether the plan was made for this very instant."""
        return self in (InputSource.OPTIMAL, InputSource.REAL_TIME, InputSource.FEASIBLE)


@dataclass(frozen=True, eq=False, kw_only=True)
class StepReport:
    """One step of a controller, whether or not an input came of it.

    Attributes:
        t: when the state was measured [s].
        applies_at: from when on the input is meant to act [s].
        status: how the solver ended at this step; None where it was not run, or raised.
        message: why the input is not ``OPTIMAL``, in words.
        residual: the solver's optimality residual; inf without a plan of this step.
        late: whether the time of this step was over: a new plan came too late for it, or there was
            none to look for another one.
        parameters: values of parameters and samples of signals of the horizon from
            ``applies_at`` on, by name, as the solver gets them.
        parameters_known: False where the controller's ``parameters`` failed; there are none then.
        new_plan: made at this step and good for later ones, though it may be late for this one;
            None where there is none.
        time_used: of this step [s].
    """

    t: float
    applies_at: float
    status: Status | None = None
    message: str = ""
    residual: float = np.inf
    late: bool = False
    parameters: Mapping[str, np.ndarray] = field(default_factory=dict)
    parameters_known: bool = True
    new_plan: Solution | None = None
    time_used: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Decision(StepReport):
    """The selected input, finite and within its limits: of a new or shifted plan, or a backup.

    Attributes:
        input: what the plant receives (m,).
        source: which rung it comes from.
        plan: the plan that the input comes from; None for the backup law.
        age: steps since that plan was made, 0 for a new one.
        clipped: by how much the input was moved to lie within its bounds.
    """

    input: np.ndarray
    source: InputSource
    plan: Solution | None = None
    age: int = 0
    clipped: float = 0.0

    def __repr__(self) -> str:
        """Return one line: when, which input, and where it comes from."""
        values = ", ".join(f"{v:.4g}" for v in self.input)
        why = f": {self.message}" if self.message else ""
        return f"<Decision at t = {self.t:g} s: ({values}), {self.source.name}{why}>"

    def _repr_html_(self) -> str:
        """Return what was decided and why, for a notebook."""
        facts = [
            ("input", np.array2string(self.input, precision=6)),
            ("source", self.source.value),
            ("why not a better one", self.message or "-"),
            ("solver", self.status.words if self.status else "not run"),
            ("measured at, acts from [s]", f"{self.t:g}, {self.applies_at:g}"),
            ("time used [s]", f"{self.time_used:.3g}"),
        ]
        return html_of(f"Decision: {self.source.name}", facts=facts)


@runtime_checkable
class PreparingController(Protocol):
    """A controller that uses the rest of an interval: ``MPC`` with ``real_time``."""

    def prepare_next(self) -> bool:
        """Prepare the next step, after one; return whether it is prepared."""
        ...


class ControlRefused(OCPError, RuntimeError):
    """There is no input to apply: no usable plan, and no backup law that helps.

    Args:
        message: why.
        report: of the step that was refused; None where a law refuses.
    """

    def __init__(self, message: str, report: StepReport | None = None) -> None:
        """Keep the step."""
        super().__init__(message)
        self.report = report


@runtime_checkable
class Controller(Protocol):
    """Anything that decides an input from a measurement: ``MPC``, ``FeedbackLaw``."""

    @property
    def delay(self) -> float:
        """Time from measurement to effect [s], a multiple of the sampling interval."""
        ...

    def reset(self, acting: np.ndarray | None = None) -> None:
        """Forget everything about earlier steps; ``acting`` acts until the first decision does."""
        ...

    def step(self, x: np.ndarray, t: float) -> Decision:
        """Decide for a state x (nx,) measured at t [s].

        Raises:
            ControlRefused: if there is no input to apply.
        """
        ...
