"""Dynamics that are faster than the steps of the grid."""

from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import eig

from ocp import evaluate
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.subject import DiagnosedProblem

# RK4 is stable for eigenvalues up to here, times the step [Hairer & Wanner 1996, IV.2].
_STABLE = 2.78
# Far beyond it no explicit method gives an answer that means anything.
_HOPELESS = 20.0
# The referee's states may differ from the solver's by this, relative to 1 + abs(x).
_DEFECT = 1e-2
# A state with this share of the largest takes part in a motion.
_TAKES_PART = 0.1


def grid(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Compare the eigenvalues of df/dx along the first iterate with the step."""
    ocp, m = subject.ocp, subject.ocp.model
    if ocp.model.is_discrete:
        return
    slopes = subject.along.evaluate(ocp, ca.jacobian(m.f, m.x)).reshape(-1, m.nx, m.nx)
    slopes = np.swapaxes(slopes, 1, 2)
    finite = np.isfinite(slopes).all(axis=(1, 2))
    if not finite.any():
        return
    values = np.linalg.eigvals(slopes[finite])
    k, i = np.unravel_index(int(np.abs(values).argmax()), values.shape)
    n = subject.program.transcription.n
    fastest, h = float(np.abs(values[k, i])), ocp.duration / n / subject.solver.integrator.steps
    if fastest * h <= _STABLE:
        return
    hopeless = fastest * h > _HOPELESS
    names = _fast(m.x_names, slopes[finite][k], fastest)
    if (given := subject.given) and given.control_kind == "polynomial":
        if not given.status.is_success:
            yield _on_a_mesh(names, fastest)
        return
    needed = int(np.ceil(fastest * ocp.duration / _STABLE))
    yield Finding(
        Cause.COARSE_GRID,
        Severity.WARNING if hopeless else Severity.ADVICE,
        names,
        f"The fastest motion, in {', '.join(names)}, has a time constant of {1 / fastest:.2g} s, "
        f"the step is {h:.2g} s ({fastest * h:.3g} time constants; RK4 is stable up to {_STABLE}). "
        f"Take {needed} steps or more (intervals times the integrator's steps), Collocation, which "
        "is implicit, or replace what is so fast by its stationary value.",
        fastest * h,
        instant=float(subject.along.t[np.flatnonzero(finite)[k]]),
    )


def _on_a_mesh(names: tuple[str, ...], fastest: float) -> Finding:
    """What to say of a collocated solution, whose method is implicit already."""
    return Finding(
        Cause.COARSE_GRID,
        Severity.WARNING,
        names,
        f"The fastest motion, in {', '.join(names)}, has a time constant of {1 / fastest:.2g} s, "
        "and the mesh does not resolve it everywhere: refine_mesh(solution) puts the intervals "
        "where they are needed.",
        1 / fastest,
        "s",
    )


def _fast(names: tuple[str, ...], slope: np.ndarray, fastest: float) -> tuple[str, ...]:
    """Return the states that take part in the fastest motion, most of all first.

    By the products of left and right eigenvectors, which no choice of units changes
    [Perez-Arriaga, Verghese & Schweppe 1982].
    """
    found: Any = eig(slope, left=True)
    values, left, right = found
    mode = int(np.abs(np.abs(values) - fastest).argmin())
    share = np.abs(left[:, mode] * right[:, mode])
    share /= share.max()
    return tuple(names[i] for i in np.argsort(-share, kind="stable") if share[i] > _TAKES_PART)


def referee(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Compare the states of the solution that was asked about, or of the trial, with the truth."""
    solution = subject.given or subject.trial
    if not (solution.status.is_success or solution.status.name == "INACCURATE"):
        return
    verdict = evaluate(solution, tolerance=1e-6)
    scale = 1.0 + float(np.abs(solution.x).max())
    if verdict.defect <= _DEFECT * scale:
        return
    truth = verdict.truth
    own = np.stack([np.interp(solution.t, truth.t, c) for c in truth.x.T], axis=1)
    off = np.nan_to_num(np.abs(own - solution.x), nan=np.inf, posinf=np.inf)
    k, i = np.unravel_index(int(off.argmax()), off.shape)
    name = subject.ocp.model.x_names[i]
    yield Finding(
        Cause.COARSE_GRID,
        Severity.WARNING,
        (name,),
        f"Integrated accurately, the controls lead {name} away from the solver's states by "
        f"{verdict.defect:.3g} {subject.unit(name)}".rstrip()
        + ": the answer lives off the integrator's error. Take more intervals or more "
        "integration steps.",
        verdict.defect,
        subject.unit(name),
        float(solution.t[k]),
    )
