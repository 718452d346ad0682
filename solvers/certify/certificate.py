"""A certificate: an optimal value as an interval, and everything that was and was not checked."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from ocp import Solution
from ocp.internal import html_of

AGREEMENT, CONVEXITY, STARTS = "agreement", "convexity", "other starts"
_MOST_DIGITS = 16.0


class Verdict(Enum):
    """The outcome of one check."""

    HOLDS = "holds"
    FAILS = "FAILS"
    NOT_CHECKED = "not checked"


@dataclass(frozen=True)
class Check:
    """One condition, and the number it was judged by.

    Attributes:
        name: what is asked.
        verdict: whether it holds.
        sentence: the evidence, or why it was not checked.
        value: the number, None where there is none.
        limit: what the number had to meet.
        decisive: whether a failure disproves the certificate; LICQ may fail at an optimum.
    """

    name: str
    verdict: Verdict
    sentence: str
    value: float | None = None
    limit: float | None = None
    decisive: bool = True

    @classmethod
    def at_most(cls, name: str, value: float, limit: float, sentence: str) -> "Check":
        """Return a check that holds where a number is at most its limit; NaN fails."""
        verdict = Verdict.HOLDS if value <= limit else Verdict.FAILS
        return cls(name, verdict, sentence, float(value), limit)

    @classmethod
    def skipped(cls, name: str, why: str) -> "Check":
        """Return a check that was not made."""
        return cls(name, Verdict.NOT_CHECKED, why)

    def __str__(self) -> str:
        """Return one line."""
        return f"{self.verdict.value:>11}  {self.name}: {self.sentence}"


@dataclass(frozen=True, eq=False)
class Estimate:
    """The optimal value by one method.

    Attributes:
        method: its name, with its settings.
        cost: the optimal value, as the referee sees it; extrapolated where the method says so.
        error: the method's own estimate of its error, at least that of the referee.
        violation: largest violation of any constraint, in the referee's eyes.
        solution: the finest answer of the method.
        sentence: how the error was estimated.
    """

    method: str
    cost: float
    error: float
    violation: float
    solution: Solution
    sentence: str

    def __repr__(self) -> str:
        """Return one line: the method and its value."""
        return f"<Estimate by {self.method}: {self.cost:.9g} +- {self.error:.1e}>"

    @property
    def is_extremal(self) -> bool:
        """Whether the answer solves the boundary value problem of the minimum principle."""
        return self.solution.control_kind == "extremal"


@dataclass(frozen=True, eq=False)
class Certificate:
    """An optimal value with its evidence.

    Attributes:
        problem: name of the problem.
        estimates: of independent methods: an extremal first, then the most accurate one.
        checks: every condition, those that were not checked too.
    """

    problem: str
    estimates: tuple[Estimate, ...]
    checks: tuple[Check, ...]

    @property
    def cost(self) -> float:
        """The value of the first method."""
        return self.estimates[0].cost

    @property
    def solution(self) -> Solution:
        """The answer of the first method."""
        return self.estimates[0].solution

    @property
    def interval(self) -> tuple[float, float]:
        """The cost, give or take its own error or the distance to the second method."""
        best, second = self.estimates[0], self.estimates[min(1, len(self.estimates) - 1)]
        error = max(best.error, abs(best.cost - second.cost))
        return self.cost - error, self.cost + error

    @property
    def digits(self) -> float:
        """To how many digits the first two methods agree; 0 with one method only."""
        if len(self.estimates) < 2:
            return 0.0
        return agreement(self.estimates[0].cost, self.estimates[1].cost)

    @property
    def holds(self) -> bool:
        """Whether two methods were compared and nothing that was checked failed."""
        failed = any(c.decisive and c.verdict is Verdict.FAILS for c in self.checks)
        return len(self.estimates) > 1 and not failed

    @property
    def scope(self) -> str:
        """Of what it is a certificate: of a local optimum, unless the problem is convex."""
        said = {check.name: check for check in self.checks}
        if CONVEXITY in said and said[CONVEXITY].verdict is Verdict.HOLDS:
            return "of the global optimum: the problem is convex"
        local = "of a LOCAL optimum; that it is the global one is not shown"
        if STARTS not in said or said[STARTS].verdict is Verdict.NOT_CHECKED:
            return f"{local}, and no other start was tried"
        cheaper = "nothing cheaper" if said[STARTS].verdict is Verdict.HOLDS else "a cheaper one"
        return f"{local}, other starts found {cheaper}"

    @property
    def not_checked(self) -> tuple[Check, ...]:
        """What the certificate does not say."""
        return tuple(c for c in self.checks if c.verdict is Verdict.NOT_CHECKED)

    def beside(self, derivation: Check) -> "Certificate":
        """Return the certificate beside a value that was derived.

        Where the two agree, it decides nothing any more how far two numerical methods do.
        """
        agree = derivation.verdict is Verdict.HOLDS
        checks = (
            replace(c, decisive=False) if agree and c.name == AGREEMENT else c for c in self.checks
        )
        return replace(self, checks=(*checks, derivation))

    def __repr__(self) -> str:
        """Return one line: whether it holds, and of what value; ``print`` shows the evidence."""
        lower, upper = self.interval
        word = "certified" if self.holds else "NOT certified"
        span = f"{self.cost:.9g} in [{lower:.9g}, {upper:.9g}]"
        return f"<Certificate of '{self.problem}': {word}, {span}>"

    def _repr_html_(self) -> str:
        """Return the whole certificate, for a notebook."""
        return html_of(f"Certificate of {self.problem}", str(self))

    def __str__(self) -> str:
        """Return the whole certificate as text."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterable[str]:
        lower, upper = self.interval
        word = "certified" if self.holds else "NOT certified"
        yield f"{self.problem}: {word}, {self.cost:.12g} in [{lower:.12g}, {upper:.12g}]"
        yield f"  {self.scope}"
        for e in self.estimates:
            yield f"  {e.method}: {e.cost:.12g} +- {e.error:.1e} ({e.sentence})"
        for check in self.checks:
            yield f"  {check}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers and texts, for a file."""
        return {
            "problem": self.problem,
            "cost": self.cost,
            "interval": list(self.interval),
            "digits": round(self.digits, 2),
            "holds": self.holds,
            "scope": self.scope,
            "estimates": [
                {"method": e.method, "cost": e.cost, "error": e.error, "how": e.sentence}
                for e in self.estimates
            ],
            "checks": [
                {
                    "name": c.name,
                    "verdict": c.verdict.value,
                    "evidence": c.sentence,
                    "decisive": c.decisive,
                }
                for c in self.checks
            ],
        }


def agreement(one: float, other: float) -> float:
    """Return to how many digits two costs agree, relative to max(1, abs(cost)).

    None where one is not finite.
    """
    apart = abs(one - other) / max(1.0, abs(one))
    if not np.isfinite(apart):
        return 0.0
    return _MOST_DIGITS if apart == 0.0 else float(min(_MOST_DIGITS, -np.log10(apart)))
