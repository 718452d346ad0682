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
        said: after how long, in words.
    """

    started: float
    budget: float
    told: bool | None
    late: bool = False
    said: str = ""

    def is_over(self) -> bool:
        """Look at the clock; once it is over it stays so."""
        used = perf_counter() - self.started
        if not self.late:
            self.late = used > self.budget if self.told is None else self.told
            self.said = f"the answer came after {used:.3g} s, too late for its step"
        return self.late
