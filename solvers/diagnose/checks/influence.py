"""What has no influence: controls, states, parameters, and costs that ask for nothing."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp import OCP
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.diagnose.graph import all_terms, depends
from solvers.diagnose.subject import DiagnosedProblem


def influence(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Follow the structure of dynamics, cost and constraints."""
    yield from _controls(subject)
    yield from _delays(subject.written)
    yield from _peaks(subject)
    yield from _goal(subject)
    yield from _parameters(subject.ocp)
    yield from _algebraic(subject)
    yield from _states(subject.ocp)


def _controls(subject: DiagnosedProblem) -> Iterator[Finding]:
    ocp, m = subject.ocp, subject.ocp.model
    path = ca.vertcat(ca.SX(0, 1), *[c.expression for c in ocp.at("path")])
    for i, name in enumerate(m.u_names):
        if name in subject.terms.origins:
            continue  # a slack of a constraint without a bound
        if not depends(m.f, m.u[i]) and not depends(path, m.u[i]):
            yield Finding(
                Cause.NO_INFLUENCE,
                Severity.ERROR,
                (name,),
                f"The control {name} appears in no dynamics and no constraint, so it moves "
                "nothing: is another symbol, or a number, in its place in f?",
                0.0,
            )


def _delays(ocp: OCP) -> Iterator[Finding]:
    for delay in ocp.delays:
        if ocp.steps is not None and delay.steps >= ocp.steps:
            yield Finding(
                Cause.NO_INFLUENCE,
                Severity.ERROR,
                (str(delay.control),),
                f"The control {delay.control} acts {delay.steps} steps after it is sent, and the "
                f"horizon has {ocp.steps}: whatever is sent moves nothing. Lengthen the horizon.",
                float(delay.steps),
            )


def _peaks(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Find peaks of what neither a control nor anything else that is chosen moves."""
    ocp, m = subject.ocp, subject.ocp.model
    moved = np.array([depends(m.f[i], m.u) for i in range(m.nx)], dtype=bool)
    moved = feeding(ocp, moved | ocp.start_is_free, forwards=True)
    by = ca.vertcat(m.u, m.x[np.flatnonzero(moved).tolist()])
    for peak in subject.written.peaks:
        if not depends(peak.expression, by):
            yield Finding(
                Cause.NO_INFLUENCE,
                Severity.WARNING,
                (peak.name,),
                f"The peak '{peak.name}' is of what no control moves: it costs the same whatever "
                "is done. Is another symbol, or a number, in its place?",
                0.0,
            )


def _algebraic(subject: DiagnosedProblem) -> Iterator[Finding]:
    """Find algebraic variables that nothing contains, nor an equation of one that is used."""
    if subject.form is None or not subject.form.original.model.nz:
        return
    ocp = subject.form.original
    m = ocp.model
    parts = (*ocp.constraints, *ocp.invariants, *ocp.peaks, *ocp.data)
    terms = ca.vertcat(m.f, ca.SX(ocp.running_cost), ca.SX(ocp.terminal_cost))
    terms = ca.vertcat(terms, *[part.expression for part in parts])
    used = np.array([depends(terms, z) for z in ca.vertsplit(m.z)], dtype=bool)
    beside = np.array(ca.DM(ca.jacobian(m.algebraic, m.z).sparsity(), 1.0)) > 0.0
    for _ in range(m.nz):
        used = used | beside[beside[:, used].any(axis=1)].any(axis=0)
    for name in np.array(m.z_names)[~used]:
        yield Finding(
            Cause.UNUSED,
            Severity.ADVICE,
            (str(name),),
            f"The algebraic variable {name} appears in no dynamics, cost or constraint: it can be "
            "left out, or something forgot it.",
            0.0,
        )


def wanted(ocp: OCP) -> np.ndarray:
    """Return on which states cost or constraints depend, bool (nx,)."""
    m = ocp.model
    terms = [ca.SX(ocp.running_cost), ca.SX(ocp.terminal_cost)]
    everything = ca.vertcat(*terms, *[c.expression for c in ocp.constraints])
    direct = np.array([depends(everything, m.x[i]) for i in range(m.nx)])
    return direct | np.isfinite(ocp.state_bounds.lower) | np.isfinite(ocp.state_bounds.upper)


def feeding(ocp: OCP, seed: np.ndarray, *, forwards: bool = False) -> np.ndarray:
    """Return the states that feed those of ``seed``, or are fed by them, these included, (nx,)."""
    edges = np.array(ca.DM(ca.jacobian(ocp.model.f, ocp.model.x).sparsity(), 1.0)) > 0.0
    edges = edges.T if forwards else edges
    found = seed.copy()
    for _ in range(ocp.model.nx):
        found = found | edges[found].any(axis=0)
    return found


def _goal(subject: DiagnosedProblem) -> Iterator[Finding]:
    ocp = subject.ocp
    if wanted(ocp).any() or ocp.has_free_time:
        return
    yield Finding(
        Cause.NO_GOAL,
        Severity.WARNING,
        subject.written.model.u_names,
        "No cost, constraint or bound looks at a state, so every control is chosen for its own "
        "price alone: was a terminal cost or constraint left out?",
        0.0,
    )


def _parameters(ocp: OCP) -> Iterator[Finding]:
    for entry in ocp.parameters:
        if not depends(all_terms(ocp), entry.symbol):
            yield Finding(
                Cause.UNUSED,
                Severity.WARNING,
                (entry.name,),
                f"'{entry.name}' is declared but appears in no dynamics, cost or constraint: is a "
                "number or another symbol in its place?",
                0.0,
            )


def _states(ocp: OCP) -> Iterator[Finding]:
    direct = wanted(ocp)
    if not direct.any():
        return
    unused = ~feeding(ocp, direct)
    for name in np.array(ocp.model.x_names)[unused]:
        yield Finding(
            Cause.UNUSED,
            Severity.ADVICE,
            (str(name),),
            f"The state {name} appears in no cost and no constraint and feeds no state that does: "
            "it can be left out, or something forgot it.",
            0.0,
        )
