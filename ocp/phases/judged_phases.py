"""A success of phases and the referee agree, or it is none; what is said is said of a phase."""

import numpy as np

from ocp.method.judged import judged
from ocp.phases.alike import undecided_durations
from ocp.phases.phases_evaluation import link_values
from ocp.phases.phases_solution import PhasesSolution
from ocp.phases.violated_phases import most_violated_phase
from ocp.problem.scaled import sizes_of
from ocp.referee.evaluate import TOLERANCE
from ocp.solution.status import Status

# A part of a nominal size that counts as zero.
_ZERO = 1e-6
# Violations above this count.
_VIOLATED = 1e-6
_ADVICE = "more intervals or a better integrator"


def judged_phases(solution: PhasesSolution, accuracy: float, slack: float = 0.0) -> PhasesSolution:
    """Return a solution whose status agrees with the referee, and its message speaks of phases.

    Each phase is judged as a problem by itself, see ``judged``; then the links, whose start is to
    follow from the true end of the phase before, and the cost of all.

    Args:
        solution: of any status; only a success is judged.
        accuracy: relative; inf: nothing is compared.
        slack: by how much an end may be missed in any case, in its own unit.
    """
    found = _judged(solution, accuracy, slack)
    said = (found.message, undecided_durations(solution.problem))
    return found.with_(message="; ".join(part for part in said if part))


def _judged(solution: PhasesSolution, accuracy: float, slack: float) -> PhasesSolution:
    if not solution.status.is_success:
        return _failed(solution)
    if not np.isfinite(accuracy):
        return solution
    said, status = [], solution.status
    for phase in solution.phases:
        found = judged(phase, accuracy, slack=slack)
        if not found.status.is_success:
            status = found.status
        if found.message:
            said.append(f"phase '{phase.problem.name}': {found.message}")
    fault = _link_fault(solution, accuracy, slack) or _cost_fault(solution, accuracy)
    if fault:
        said, status = [*said, f"{fault}: {_ADVICE}"], Status.INACCURATE
    message = "; ".join(part for part in (solution.message, *said) if part)
    return solution.with_(status=status, message=message)


def _failed(solution: PhasesSolution) -> PhasesSolution:
    """Say in terms of the phases what the method could not meet."""
    for name, duration in zip(solution.problem.names, solution.durations, strict=True):
        if duration <= 0.0:  # of a method that does not impose bounds
            return solution.with_(message=f"the duration of phase '{name}' is {duration:.3g} s")
    amount, said = most_violated_phase(solution.side, solution.whole)
    if amount > _VIOLATED:
        return solution.with_(message=said)
    if not solution.message:
        return solution
    return solution.with_(message=f"phases side by side on [0, 1]: {solution.message}")


def _cost_fault(solution: PhasesSolution, accuracy: float) -> str:
    own, costs = solution.cost, np.array([phase.cost for phase in solution.phases])
    cost = float(costs.sum())
    size = max(float(np.abs(costs).sum()), _ZERO * sizes_of(solution.side.problem).cost)
    if abs(own - cost) <= accuracy * size:
        return ""
    return f"own cost {own:.6g}, the referee's {cost:.6g}"


def _link_fault(solution: PhasesSolution, accuracy: float, slack: float) -> str:
    """Return which link is missed; empty where none is."""
    side, whole = solution.side, solution.whole
    if not side.chain.couplings:
        return ""
    sizes = np.max(
        [np.abs(np.concatenate(link_values(side, whole, x, whole.x[0]))) for x in whole.x], axis=0
    )
    missed = np.abs(np.concatenate(solution.evaluated(TOLERANCE).links))
    labels = [label for coupling in side.chain.couplings for label in coupling.labels]
    off = missed > accuracy * np.maximum(sizes, _ZERO) + slack
    if not off.any():
        return ""
    i = int(np.where(off, missed, 0.0).argmax())
    return f"{labels[i]} misses the end of the phase before by {missed[i]:.2g}"
