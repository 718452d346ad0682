"""One run that is drawn: its curves, and where its phases begin."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ocp.checks.errors import ProblemError
from ocp.plotting.curve import Curve, one_after_another
from ocp.plotting.curves import curves_of
from ocp.plotting.plottable import PlottableSolution


@dataclass(frozen=True, eq=False)
class Run:
    """What a picture needs of one solution, or of one with several phases.

    Attributes:
        problem: its name.
        curves: of everything in it.
        phases: their names; empty where there is one.
        edges: when each phase begins, and when the last one ends [s].
    """

    problem: str
    curves: tuple[Curve, ...]
    phases: tuple[str, ...]
    edges: np.ndarray

    @classmethod
    def of(cls, problem: str, phases: Sequence[PlottableSolution], names: Sequence[str]) -> "Run":
        """Return the run of phases one after another."""
        parts: dict[tuple[str, str, str], list[Curve]] = {}
        whole = _clock(phases)
        for k, phase in enumerate(phases):
            for curve in curves_of(phase):
                key = (curve.role, curve.name, curve.unit)
                gaps = [_missing(curve, t) for t in whole]
                parts.setdefault(key, gaps)[k] = curve
        curves = tuple(one_after_another(found) for found in parts.values())
        edges = np.array([*(phase.t[0] for phase in phases), phases[-1].t[-1]])
        return cls(problem, curves, tuple(names) if len(phases) > 1 else (), edges)

    def same_variables_as(self, other: "Run") -> None:
        """Raise ``ProblemError`` if the states and controls have other names."""
        own, theirs = (
            [c.name for c in run.curves if c.role in ("state", "control")] for run in (self, other)
        )
        if set(own) != set(theirs):
            raise ProblemError(
                f"plot: compare: '{other.problem}' has {', '.join(theirs)}, but '{self.problem}' "
                f"has {', '.join(own)}: solutions of different problems have nothing in common"
            )


def _clock(phases: Sequence[PlottableSolution]) -> list[np.ndarray]:
    return [curves_of(phase)[0].t for phase in phases] if len(phases) > 1 else [phases[0].t]


def _missing(curve: Curve, t: np.ndarray) -> Curve:
    """Return a curve without values, for a phase that does not have it."""
    return Curve(curve.name, curve.unit, curve.role, t, np.full(len(t), np.nan))
