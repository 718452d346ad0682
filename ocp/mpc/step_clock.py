"""The time of one control step: is it over?"""

from dataclasses import dataclass
from time import perf_counter


@dataclass(eq=False)
class StepClock:
    """The time of one step.

    Attributes:
        started: when it began, of ``perf_counter`` [s].
        budget: what it may take [s].
        told: whether it is over, where somebody else decides that.
        late: whether it was found to be over.
    """

    started: float
    budget: float
    told: bool | None
    late: bool = False
    _used: float = 0.0

    def is_over(self) -> bool:
        """Look at the clock; once it is over it stays so."""
        if not self.late:
            self._used = perf_counter() - self.started
            self.late = self._used > self.budget if self.told is None else self.told
        return self.late

    @property
    def said(self) -> str:
        """After how long it was found to be over, in words."""
        return f"the answer came after {self._used:.3g} s, too late for its step"
