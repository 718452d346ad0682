"""A verdict of the referee in one line, and as facts for a notebook."""

from typing import Protocol


class Verdict(Protocol):
    """What ``Evaluation`` and ``PhasesEvaluation`` have in common."""

    @property
    def cost(self) -> float:
        """True cost."""
        ...

    @property
    def cost_error(self) -> float:
        """Bound of its error."""
        ...

    @property
    def violation(self) -> float:
        """Largest violation."""
        ...

    @property
    def worst(self) -> str:
        """Of what, and when."""
        ...

    @property
    def defect(self) -> float:
        """Largest distance of the solution's states from the true ones."""
        ...


def verdict_in_words(verdict: Verdict) -> str:
    """Return cost and violation in one line."""
    broken = f"{verdict.worst} ({verdict.violation:.2g})" if verdict.worst else "nothing violated"
    return f"cost {verdict.cost:.9g} +- {verdict.cost_error:.1g}, {broken}"


def verdict_facts(verdict: Verdict, stationarity: float | None) -> list[tuple[str, str]]:
    """Return the numbers by name."""
    residual = "not known here" if stationarity is None else f"{stationarity:.2g}"
    return [
        ("true cost", f"{verdict.cost:.9g} +- {verdict.cost_error:.1g}"),
        ("largest violation", f"{verdict.violation:.2g}"),
        ("of", verdict.worst or "nothing"),
        ("residual of the minimum principle", residual),
        ("distance of the solution's states from the true ones", f"{verdict.defect:.2g}"),
    ]
