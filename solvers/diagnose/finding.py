"""One thing that is wrong: what, where, when, by how much, and what to do."""

from dataclasses import dataclass
from enum import IntEnum

from solvers.diagnose.cause import Cause


class Severity(IntEnum):
    """How sure it is that something is wrong; smaller is more serious."""

    #: No solver can give a meaningful answer.
    ERROR = 0
    #: An answer may come, but most likely not to the problem that was meant.
    WARNING = 1
    #: Nothing is wrong for certain; worth a look.
    ADVICE = 2


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Attributes:
        cause: what kind of thing.
        severity: how sure and how bad it is.
        where: the constraints, states, controls, parameters concerned, by name.
        sentence: what was found and what to do about it, for a person.
        evidence: the number behind it, in ``unit``.
        unit: unit of the evidence; empty where it has none or none was declared.
        instant: when [s]; None where no single instant is concerned.
    """

    cause: Cause
    severity: Severity
    where: tuple[str, ...]
    sentence: str
    evidence: float
    unit: str = ""
    instant: float | None = None

    def __str__(self) -> str:
        """Return severity, cause, place and sentence."""
        at = "" if self.instant is None else f" at t = {self.instant:.4g} s"
        names = ", ".join(self.where)
        return f"{self.severity.name}: {self.cause.value} ({names}{at}). {self.sentence}"
