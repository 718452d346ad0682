"""A free final time that shrinks to nothing or grows without end."""

from collections.abc import Iterator
from dataclasses import replace

from ocp import FreeTime, Guess
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.subject import DiagnosedProblem

# A lower bound below this share of the guess is none; the time sits on it within _AT of it.
_TINY, _AT = 0.05, 0.05
# Beyond this many times the guess the time has run away.
_ENDLESS = 20.0
# It has settled where this many times as long costs more, by this share at least.
_LONGER, _DEARER = 2.0, 1e-3


def free_time(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Check the duration with which the trial ended."""
    horizon = subject.ocp.horizon
    if not isinstance(horizon, FreeTime):
        return
    duration = subject.trial.duration
    if duration <= horizon.lower * (1.0 + _AT):
        yield _vanishing(horizon, duration)
    elif duration >= horizon.upper * (1.0 - 1e-3) or (
        duration >= _ENDLESS * horizon.guess and not _has_settled(subject, duration)
    ):
        yield _endless(horizon, duration)


def _has_settled(subject: DiagnosedProblem, duration: float) -> bool:
    """Whether a longer time costs more: then the guess was short, and nothing is endless."""
    trial, data = subject.trial, subject.data
    if not trial.status.is_success:
        return False
    longer = replace(subject.ocp, horizon=_LONGER * duration, guess=None)
    found = subject.solver.build(longer).run(
        x0=data.x0, t0=data.t0, parameters=data.values.as_dict(), guess=Guess(x=trial.x, u=trial.u)
    )
    return found.status.is_success and found.cost > trial.cost + _DEARER * abs(trial.cost)


def _vanishing(horizon: FreeTime, duration: float) -> Finding:
    tiny = horizon.lower <= _TINY * horizon.guess
    return Finding(
        Cause.VANISHING_TIME,
        Severity.WARNING if tiny else Severity.ADVICE,
        ("final time",),
        f"The optimal final time is its lower bound, {duration:.3g} s: nothing has to happen "
        "first. Is a terminal constraint missing, met at the start already, or a weight on time "
        "too large? If a shortest time is meant, set FreeTime(lower=...).",
        duration,
        "s",
    )


def _endless(horizon: FreeTime, duration: float) -> Finding:
    runaway = duration >= _ENDLESS * horizon.guess
    return Finding(
        Cause.ENDLESS_TIME,
        Severity.WARNING if runaway else Severity.ADVICE,
        ("final time",),
        f"The final time grew to {duration:.3g} s (the guess is {horizon.guess:.3g} s, the upper "
        f"bound {horizon.upper:.3g} s): the longer, the cheaper. Charge for time (running cost "
        "1), or set FreeTime(upper=...).",
        duration,
        "s",
    )
