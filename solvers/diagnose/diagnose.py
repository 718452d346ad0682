"""``diagnose``: all checks on one problem, those that need no solve first."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ocp import OCP, Phases, PhasesSolution, ProblemError, Solution, UnsupportedProblem
from ocp.internal import RunData, normal_form
from solvers.diagnose.cause import Cause
from solvers.diagnose.checks.activity import activity
from solvers.diagnose.checks.cheap_soft import cheap_soft
from solvers.diagnose.checks.curvature import curvature
from solvers.diagnose.checks.degrees import degrees
from solvers.diagnose.checks.duplicate import duplicate
from solvers.diagnose.checks.free_time import free_time
from solvers.diagnose.checks.grid import grid, referee
from solvers.diagnose.checks.guess import guess
from solvers.diagnose.checks.identifiable import identifiable
from solvers.diagnose.checks.infeasible import infeasible
from solvers.diagnose.checks.influence import influence
from solvers.diagnose.checks.instants import instants
from solvers.diagnose.checks.kink import declared_kinks, kink
from solvers.diagnose.checks.not_finite import not_finite, not_finite_after
from solvers.diagnose.checks.outlier import outlier
from solvers.diagnose.checks.scaling import scaling
from solvers.diagnose.checks.time_kind import time_kind
from solvers.diagnose.checks.unbounded import unbounded
from solvers.diagnose.checks.unreachable import unreachable
from solvers.diagnose.checks.vacuous import vacuous
from solvers.diagnose.diagnosis import Diagnosis
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.subject import DiagnosedProblem
from solvers.direct.multiple_shooting import MultipleShooting

CheckFunction = Callable[[DiagnosedProblem], Iterator[Finding]]

# Reading, evaluating, solving at one instant.
_BEFORE: tuple[CheckFunction, ...] = (
    not_finite,
    degrees,
    time_kind,
    vacuous,
    instants,
    influence,
    unreachable,
    curvature,
    grid,
    duplicate,
    kink,
    guess,
    outlier,
    identifiable,
)
# What a trial solve shows.
_AFTER: tuple[CheckFunction, ...] = (
    free_time,
    unbounded,
    infeasible,
    referee,
    scaling,
    cheap_soft,
    activity,
)

# What cannot be where there is a trajectory.
_DISPROVED = (
    Cause.NOT_FINITE,
    Cause.START_VIOLATES,
    Cause.CONTRADICTION,
    Cause.UNREACHABLE,
    Cause.OUT_OF_REACH,
    Cause.CONFLICT,
)

# Enough for a trial; a solve that needs more is reported as such.
_ITERATIONS = 200


def diagnose(asked: OCP | Solution, *, intervals: int = 50) -> Diagnosis:
    """Say what is wrong with a problem, or with the problem behind a solution.

    Every check looks for one kind of mistake; its findings name constraint, state or control,
    instant, unit and amount, and what to do. Where a check that needs no solve finds an
    error, no solve is tried: what it would show is a consequence.

    Args:
        asked: a problem, or a solution of it by any solver; of the latter also start, initial
            time, parameters, and the distance of its states from the true ones.
        intervals: grid of the trial solve, for problems in continuous time.

    Returns:
        findings, the most probable cause first; none where nothing was found. That is no proof:
        a well-posed problem that is not the one that was meant looks like any other.

    Raises:
        ProblemError: if ``asked`` is neither.
        UnsupportedProblem: if it is made of phases.
    """
    if isinstance(asked, Phases | PhasesSolution):
        raise UnsupportedProblem(
            "diagnose takes no phases: diagnose each by itself, with the states that a link "
            "decides in its free_start; a solution of one phase is solution.phases[i]"
        )
    if not isinstance(asked, OCP | Solution):
        raise ProblemError(f"diagnose takes an OCP or a Solution, not {type(asked).__name__}")
    subject = _subject(asked, MultipleShooting(intervals, max_iterations=_ITERATIONS))
    with np.errstate(all="ignore"):  # checks report what is not finite; no warnings
        findings = [finding for check in _BEFORE for finding in check(subject)]
        findings = _tested(subject, findings)
        if not any(_explains(f) for f in findings):
            findings += [finding for check in _AFTER for finding in check(subject)]
            findings += _unsolved(subject, findings)
        findings = _tested(subject, findings)
    return Diagnosis.of(subject.ocp.name, [subject.terms.said(f) for f in findings])


def _subject(asked: OCP | Solution, solver: MultipleShooting) -> DiagnosedProblem:
    form = normal_form(asked.problem if isinstance(asked, Solution) else asked)
    if form is not None:
        normal = asked.normal if isinstance(asked, Solution) else None
        asked = normal or form.problem
    if isinstance(asked, Solution):
        return DiagnosedProblem(asked.problem, asked.data, solver, asked, form)
    data = RunData(asked.start(), 0.0, asked.parameter_values())
    return DiagnosedProblem(asked, data, solver, form=form)


def _tested(subject: DiagnosedProblem, findings: list[Finding]) -> list[Finding]:
    """Return the findings that an answer leaves: no error remains where there is one.

    What says that there is no trajectory is disproved by one and left out; what says that an
    answer means nothing becomes a warning.
    """
    if not any(f.severity is Severity.ERROR for f in findings) or not subject.is_solved:
        return findings
    return [
        replace(f, severity=Severity.WARNING) if f.severity is Severity.ERROR else f
        for f in findings
        if f.severity is not Severity.ERROR or f.cause not in _DISPROVED
    ]


def _explains(finding: Finding) -> bool:
    """Whether a trial would only show consequences: after an error, on a hopeless grid."""
    hopeless = finding.cause is Cause.COARSE_GRID and finding.severity is Severity.WARNING
    return finding.severity is Severity.ERROR or hopeless


def _unsolved(subject: DiagnosedProblem, findings: list[Finding]) -> Iterator[Finding]:
    """Return that the trial failed, where no finding explains it."""
    trial = subject.trial
    if trial.status.is_success or any(f.severity is not Severity.ADVICE for f in findings):
        return
    known = [*not_finite_after(subject), *declared_kinks(subject)]
    yield from known
    if known:
        return
    yield Finding(
        Cause.UNSOLVED,
        Severity.WARNING,
        (subject.ocp.name,),
        f"Multiple shooting ended with {trial.status.name}: {trial.status.value}. "
        f"{trial.message}".rstrip()
        + " Give a guess of the trajectory, or try multistart.",
        float(trial.iterations),
    )
