"""A guess that lies outside the bounds."""

from collections.abc import Iterator

import numpy as np

from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.subject import DiagnosedProblem

_EXCESS = 1e-6


def guess(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Compare the problem's own guess with the bounds of states and controls."""
    ocp, m = subject.ocp, subject.ocp.model
    if ocp.guess is None:
        return
    fractions = subject.program.transcription.fractions
    for part, names, box in (
        ("x", m.x_names, ocp.state_bounds),
        ("u", m.u_names, ocp.control_bounds),
    ):
        values = ocp.guess.sample(part, fractions, len(names))
        if values is None:
            continue
        excess = box.excess(values)
        k, i = np.unravel_index(int((excess / (1.0 + np.abs(values))).argmax()), excess.shape)
        if excess[k, i] > _EXCESS * (1.0 + abs(values[k, i])):
            t = subject.data.t0 + float(fractions[k]) * ocp.duration
            unit = subject.unit(names[i])
            yield Finding(
                Cause.GUESS_OUTSIDE,
                Severity.WARNING,
                (names[i],),
                f"The guess has {names[i]} = {values[k, i]:.4g} {unit}".rstrip()
                + f", {excess[k, i]:.3g} beyond its bounds; it is cut off there and says nothing. "
                "Guess within the bounds, or widen them.",
                float(excess[k, i]),
                unit,
                t,
            )
