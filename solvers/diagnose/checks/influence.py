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
    yield from _controls(subject.ocp)
    yield from _goal(subject.ocp)
    yield from _parameters(subject.ocp)
    yield from _states(subject.ocp)


def _controls(ocp: OCP) -> Iterator[Finding]:
    m = ocp.model
    path = ca.vertcat(ca.SX(0, 1), *[c.expression for c in ocp.at("path")])
    for i, name in enumerate(m.u_names):
        if not depends(m.f, m.u[i]) and not depends(path, m.u[i]):
            yield Finding(
                Cause.NO_INFLUENCE,
                Severity.ERROR,
                (name,),
                f"The control {name} appears in no dynamics and no constraint, so it moves "
                "nothing: is another symbol, or a number, in its place in f?",
                0.0,
            )


def wanted(ocp: OCP) -> np.ndarray:
    """Return on which states cost or constraints depend, bool (nx,)."""
    m = ocp.model
    terms = [ca.SX(ocp.running_cost), ca.SX(ocp.terminal_cost)]
    everything = ca.vertcat(*terms, *[c.expression for c in ocp.constraints])
    direct = np.array([depends(everything, m.x[i]) for i in range(m.nx)])
    return direct | np.isfinite(ocp.state_bounds.lower) | np.isfinite(ocp.state_bounds.upper)


def feeding(ocp: OCP, seed: np.ndarray) -> np.ndarray:
    """Return the states that feed those of ``seed``, these included, bool (nx,)."""
    edges = np.array(ca.DM(ca.jacobian(ocp.model.f, ocp.model.x).sparsity(), 1.0)) > 0.0
    found = seed.copy()
    for _ in range(ocp.model.nx):
        found = found | edges[found].any(axis=0)
    return found


def _goal(ocp: OCP) -> Iterator[Finding]:
    if wanted(ocp).any() or ocp.has_free_time:
        return
    yield Finding(
        Cause.NO_GOAL,
        Severity.WARNING,
        ocp.model.u_names,
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
