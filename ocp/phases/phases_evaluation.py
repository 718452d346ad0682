"""The verdict on a solution of phases: what they cost, violate, and miss from one to the next."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ocp.checks.rich_text import html_of
from ocp.phases.side_by_side import SideBySide
from ocp.referee.evaluate import Evaluation, evaluate
from ocp.referee.verdict_in_words import verdict_facts, verdict_in_words
from ocp.solution.solution import Solution


@dataclass(frozen=True, eq=False)
class PhasesEvaluation:
    """The verdict on a solution of phases.

    The controls of every phase are integrated by themselves, from where it starts to its end; what
    the start of the next phase then misses is a violation of the link between them.

    Attributes:
        phases: verdicts on the phases, each by itself. Their ``stationarity`` is that of a phase
            that is alone: it says nothing of one that another follows.
        cost: true cost of all phases.
        cost_error: bound of its error, with what the links are missed by, by the costates.
        violation: largest violation of a bound, constraint, link or coupling of times.
        worst: which one, in which phase, and when; empty where nothing is violated.
        links: by how much every link is missed, (m,) each.
        defect: largest distance of the states from the true ones at the nodes.
        task_drift: largest violation of the phases' invariants.
        whole: the phases side by side, of which stationarity is computed.
    """

    phases: tuple[Evaluation, ...]
    cost: float
    cost_error: float
    violation: float
    worst: str
    links: tuple[np.ndarray, ...]
    defect: float
    task_drift: float
    whole: Solution

    def __repr__(self) -> str:
        """Return one line: what the controls cost and violate."""
        return f"<Evaluation of {len(self.phases)} phases: {verdict_in_words(self)}>"

    def _repr_html_(self) -> str:
        """Return the numbers, for a notebook."""
        return html_of("Evaluation", facts=verdict_facts(self, self.stationarity))

    @cached_property
    def stationarity(self) -> float | None:
        """Residual of the minimum principle for all phases with their links and durations.

        See ``Evaluation``; computed when asked for, along the phases side by side.
        """
        return evaluate(self.whole).stationarity


def evaluate_phases(
    side: SideBySide, whole: Solution, phases: tuple[Solution, ...], tolerance: float
) -> PhasesEvaluation:
    """Judge phases by integrating the controls of each; see ``evaluate``."""
    verdicts = tuple(evaluate(phase, tolerance=tolerance) for phase in phases)
    links = missed_links(side, whole, verdicts)
    found = list(other_violations(side, whole, links))
    for name, verdict in zip(side.chain.names, verdicts, strict=True):
        found.append((verdict.violation, f"{verdict.worst}, in phase '{name}'"))
    violation, worst = max(found, key=lambda pair: pair[0])
    return PhasesEvaluation(
        phases=verdicts,
        cost=sum(verdict.cost for verdict in verdicts),
        cost_error=sum(v.cost_error for v in verdicts) + _worth(side, whole, phases, links),
        violation=violation,
        worst=worst if violation > 0.0 else "",
        links=links,
        defect=max(verdict.defect for verdict in verdicts),
        task_drift=max(verdict.task_drift for verdict in verdicts),
        whole=whole,
    )


def missed_links(
    side: SideBySide, whole: Solution, verdicts: tuple[Evaluation, ...]
) -> tuple[np.ndarray, ...]:
    """Return the rows of every link between the true end of a phase and the start of the next."""
    end, start = whole.x[-1].copy(), whole.x[0]
    for lane, verdict in zip(side.lanes, verdicts, strict=True):
        reached = verdict.truth.x[-1]
        end[lane.x.start : lane.x.start + len(reached)] = reached
    rows = link_values(side, whole, end, start)
    return tuple(np.where(np.isnan(missed), np.inf, missed) for missed in rows)


def link_values(
    side: SideBySide, whole: Solution, end: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return the rows of every link, for states of all phases (nx,) at their ends and starts."""
    p = _at_end(side, whole, start)
    return tuple(np.array(f(end, 1.0, p)[0]).ravel() for f in side.link_functions)


def _at_end(side: SideBySide, whole: Solution, start: np.ndarray) -> np.ndarray:
    """Return the parameters of the one problem at its end (n_p,)."""
    return side.problem.values_of(whole.parameters, whole.unknowns, start).at(1.0)[0]


def _worth(
    side: SideBySide,
    whole: Solution,
    phases: tuple[Solution, ...],
    links: tuple[np.ndarray, ...],
) -> float:
    """Return what missed links change the cost by, to first order.

    With multipliers nu of the rows g(end, start), the costates of the decided part of the start
    are -g_start' nu.
    """
    p, total = _at_end(side, whole, whole.x[0]), 0.0
    each = zip(side.chain.couplings, side.link_functions, links, strict=True)
    for coupling, function, missed in each:
        slope = np.array(function(whole.x[-1], 1.0, p)[1])
        costate = phases[coupling.after].costate[0, list(coupling.decided)]
        nu = np.linalg.lstsq(slope.T, costate, rcond=None)[0]
        total += abs(float(nu @ missed)) if np.isfinite(missed).all() else np.inf
    return total


def other_violations(
    side: SideBySide, whole: Solution, links: tuple[np.ndarray, ...]
) -> Iterator[tuple[float, str]]:
    """Yield by how much links, shared constants and the total duration are violated, and which."""
    chain = side.chain
    for coupling, rows in zip(chain.couplings, links, strict=True):
        i = int(np.abs(rows).argmax())
        yield float(np.abs(rows[i])), f"the link: {coupling.labels[i]}"
    for unknown in chain.unknowns:
        yield float(unknown.box.excess(whole.unknowns[unknown.name]).max()), unknown.name
    if (box := chain.total_box) is not None:
        total = side.durations(whole.unknowns).sum()
        yield float(box.excess(np.array([total]))[0]), "the total duration"
