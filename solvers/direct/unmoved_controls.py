"""Which controls a backend left at its first iterate: symmetry may have hidden a better answer."""

import numpy as np

from solvers.direct.nlp_verdict import NlpInputs
from solvers.direct.transcribed_problem import TranscribedProblem
from solvers.direct.warm_start import UNCHANGED

# Standard deviation of the perturbation of the controls, relative to 1 + abs(u).
_PERTURBATION = 1e-3


def unmoved(problem: TranscribedProblem, inputs: NlpInputs, w: np.ndarray) -> np.ndarray:
    """Return which controls are those of the first iterate all along the horizon, bool (nu,)."""
    before, after = (_controls(problem, each) for each in (inputs.w0, w))
    changed = np.abs(after - before) > UNCHANGED * (1.0 + np.abs(before))
    return ~np.asarray(changed.any(axis=0))


def at_bounds(problem: TranscribedProblem, inputs: NlpInputs, w: np.ndarray) -> np.ndarray:
    """Return which controls are at a bound all along the horizon, bool (nu,)."""
    u, lower, upper = (
        _controls(problem, each) for each in (w, inputs.bounds["lbx"], inputs.bounds["ubx"])
    )
    near = UNCHANGED * (1.0 + np.abs(u))
    inside = (u - lower > near) & (upper - u > near)
    return ~np.asarray(inside.any(axis=0))


def perturbed(
    problem: TranscribedProblem, inputs: NlpInputs, w: np.ndarray, which: np.ndarray
) -> np.ndarray:
    """Return unknowns with slightly different controls; the same for the same unknowns.

    Args:
        problem: on its grid.
        inputs: whose bounds they stay in.
        w: the unknowns.
        which: the controls that are changed, bool (nu,).
    """
    w, at = w.copy(), problem.is_control
    u = w[at]
    noise = np.random.default_rng(0).normal(size=u.shape) * np.tile(which, u.size // which.size)
    w[at] += _PERTURBATION * noise * (1.0 + np.abs(u))
    return np.clip(w, inputs.bounds["lbx"], inputs.bounds["ubx"])


def _controls(problem: TranscribedProblem, w: np.ndarray) -> np.ndarray:
    """Return the controls of a vector of unknowns, or their coefficients, one row an instant."""
    return w[problem.is_control].reshape(-1, problem.ocp.model.nu)
