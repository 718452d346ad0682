"""Everything that was found, the most probable cause first."""

from collections.abc import Iterable
from dataclasses import dataclass

from ocp.internal import html_of
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity

_ORDER = {cause: rank for rank, cause in enumerate(Cause)}


@dataclass(frozen=True)
class Diagnosis:
    """What is wrong with a problem.

    Attributes:
        problem: its name.
        findings: advice last; otherwise causes before their consequences.
    """

    problem: str
    findings: tuple[Finding, ...]

    @classmethod
    def of(cls, problem: str, findings: Iterable[Finding]) -> "Diagnosis":
        """Put findings in order; of those with one cause and place the first is kept."""
        kept = {(f.cause, f.where): f for f in reversed(list(findings))}
        ordered = sorted(reversed(kept.values()), key=_rank)
        return cls(problem, tuple(ordered))

    @property
    def first(self) -> Finding | None:
        """The most probable cause; None where nothing was found."""
        return self.findings[0] if self.findings else None

    @property
    def serious(self) -> tuple[Finding, ...]:
        """Errors and warnings, without advice."""
        return tuple(f for f in self.findings if f.severity is not Severity.ADVICE)

    def __repr__(self) -> str:
        """Return one line: what was found first; ``print`` shows everything."""
        first = self.first
        said = f"{first.cause.value} ({', '.join(first.where)})" if first else "nothing found"
        more = len(self.findings) - 1
        return f"<Diagnosis of '{self.problem}': {said}{f', and {more} more' * (more > 0)}>"

    def _repr_html_(self) -> str:
        """Return all findings, for a notebook."""
        return html_of("Diagnosis", str(self))

    def __str__(self) -> str:
        """Return one numbered paragraph for each finding."""
        if not self.findings:
            return f"{self.problem}: nothing found."
        lines = [f"{i}. {finding}" for i, finding in enumerate(self.findings, start=1)]
        return "\n".join([f"{self.problem}:", *lines])


def _rank(finding: Finding) -> tuple[bool, int]:
    return finding.severity is Severity.ADVICE, _ORDER[finding.cause]
