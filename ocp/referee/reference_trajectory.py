"""What a solution's controls really do: the plant integrated until the cost holds still."""

from dataclasses import dataclass, replace

import numpy as np

from ocp.referee.control_integrators import Steps, integrator_of
from ocp.solution.solution import Solution

# Refinement stops at this many integration steps whatever the error still is.
_MOST_STEPS = 2**15
_FEWEST_STEPS = 400
_FEWEST_PER_INTERVAL = 4


@dataclass(frozen=True, eq=False)
class ReferenceTrajectory:
    """A solution's controls applied to its problem, on a fine grid of K steps.

    Attributes:
        t: (K + 1,) [s].
        x: (K + 1, nx).
        u_start: control at the start of each step, (K, nu).
        u_end: control at the end of each step (its limit from the left), (K, nu).
        drive: what determines the control in each step, see ``Integrated``.
        p_start: parameters at the start of each step, (K, n_p).
        p_end: parameters at the end of each step, (K, n_p).
        cost: running plus terminal cost.
        cost_error: by how much the last refinement changed the cost.
        substeps: steps per interval of the solution.
    """

    t: np.ndarray
    x: np.ndarray
    u_start: np.ndarray
    u_end: np.ndarray
    drive: tuple[np.ndarray, ...]
    p_start: np.ndarray
    p_end: np.ndarray
    cost: float
    cost_error: float
    substeps: int

    @property
    def is_finite(self) -> bool:
        """Whether the integration stayed finite."""
        return bool(np.isfinite(self.cost) and np.isfinite(self.x).all())


def integrate_controls(solution: Solution, *, tolerance: float = 1e-9) -> ReferenceTrajectory:
    """Integrate a solution's controls from its start, refining until cost and end hold still.

    The steps are halved until the cost changes by less than ``tolerance`` (relative to
    1 + cost) and the final state by less than a thousand times that: close to a singular
    configuration it goes on moving long after the cost has settled.

    Args:
        solution: controls of any kind; the start is the one that was asked for, or the
            solution's own where the problem leaves it free.
        tolerance: accepted change of the cost under halving the steps.

    Returns:
        the finest trajectory; not finite if the integration blows up.
    """
    if solution.problem.model.is_discrete:
        return _integrated(solution, 1)
    intervals = len(_knots(solution)) - 1
    substeps = max(_FEWEST_PER_INTERVAL, -(-_FEWEST_STEPS // intervals))
    truth = _integrated(solution, substeps)
    while truth.is_finite and 2 * substeps * intervals <= _MOST_STEPS:
        substeps *= 2
        finer = _integrated(solution, substeps)
        change = abs(finer.cost - truth.cost) / (1.0 + abs(finer.cost))
        moved = np.abs(finer.x[-1] - truth.x[-1]).max() / (1.0 + np.abs(finer.x[-1]).max())
        truth = replace(finer, cost_error=abs(finer.cost - truth.cost))
        if change <= tolerance and moved <= 1e3 * tolerance:
            break
    return truth


def adjoint(
    solution: Solution, truth: ReferenceTrajectory, final: np.ndarray
) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Return costates (K + 1, nx), and gradients dJ/du at both ends of each step, (K, nu) each.

    Between those of the ends stands that of the middle, where the control is polynomial.
    The adjoint of the discretised trajectory itself, from ``final`` backwards: consistent
    to the order of the integrator, with no error of its own. For an extremal the gradients
    are zero: its controls have no parameters.
    """
    steps = np.diff(truth.t)[:, None]
    inputs = [truth.x[:-1], *truth.drive, truth.t[:-1, None], steps, truth.p_start, truth.p_end]
    backwards = [array[::-1] for array in inputs]
    costate, *gradients = integrator_of(solution).adjoint([final], backwards)
    return np.vstack([costate[::-1], final]), tuple(g[::-1] for g in gradients)


def _knots(solution: Solution) -> np.ndarray:
    """Fractions of the horizon between which controls and signals are smooth."""
    values = solution.problem.parameter_values(solution.parameters)
    knots = np.union1d(solution.fractions, values.knots)
    return knots[np.concatenate([[True], np.diff(knots) > 1e-9])]


def _integrated(solution: Solution, substeps: int) -> ReferenceTrajectory:
    ocp = solution.problem
    knots = solution.fractions if ocp.model.is_discrete else _knots(solution)
    inside = np.arange(substeps) / substeps
    fine = np.append((knots[:-1, None] + inside * np.diff(knots)[:, None]).ravel(), 1.0)
    t = solution.t[0] + fine * solution.duration
    values = ocp.parameter_values(solution.parameters)
    steps = Steps(fine, t, *values.on(fine))
    start = solution.x[0] if ocp.has_free_start else solution.x0
    found = integrator_of(solution).integrate(solution, steps, start)
    terminal = float(ocp.functions.terminal_cost(found.x[-1], t[-1], values.at(1.0)[0]))
    return ReferenceTrajectory(
        t=t,
        x=found.x,
        u_start=found.u_start,
        u_end=found.u_end,
        drive=found.drive,
        p_start=steps.p_start,
        p_end=steps.p_end,
        cost=found.running_cost + terminal,
        cost_error=0.0,
        substeps=substeps,
    )
