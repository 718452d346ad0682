"""The condition number of the Karush-Kuhn-Tucker matrix, and how much of it is scaling."""

from dataclasses import dataclass

import numpy as np

from ocp.internal import without_traces
from solvers.diagnose.subject import DiagnosedProblem

# A bound this close, relative to 1 + abs(bound), is taken as active.
_ACTIVE = 1e-5
# Singular values below this share of the largest count as zero where multipliers are fitted.
_DEPENDENT = 1e-9
# Rounds of the balancing; it converges linearly, by a half each.
_ROUNDS = 20
# A larger matrix would take longer than the trial itself.
_LARGEST = 1000


@dataclass(frozen=True)
class Conditioning:
    r"""Of the matrix that a Newton step at the trial's answer solves with.

    .. math:: K = \begin{pmatrix} \nabla^2_{ww} L & A' \\ A & 0 \end{pmatrix}

    with the free unknowns w and the gradients A of the active rows. It is balanced by a diagonal
    matrix on both sides until the largest entry of every row is 1 [Ruiz 2001]. What balancing
    takes away was scaling; what remains lies in the problem: rows that depend on each other, or
    a direction without curvature.

    Attributes:
        raw: condition number as the problem is written.
        balanced: of the balanced matrix.
        large: state or control whose unit is the largest for the matrix: divide by more.
        small: that whose unit is the smallest.
    """

    raw: float
    balanced: float
    large: str
    small: str

    @property
    def gain(self) -> float:
        """By what factor balancing lowers the condition number; 1 where that is not defined."""
        return self.raw / self.balanced if np.isfinite(self.raw) else 1.0

    def __str__(self) -> str:
        """Return a sentence."""
        return (
            f"The KKT matrix of the trial has the condition number {self.raw:.1e}, and "
            f"{self.balanced:.1e} once it is balanced."
        )


def conditioning(subject: DiagnosedProblem) -> Conditioning | None:
    """Return the conditioning at the trial's answer; None where it failed or is too large."""
    tr, trial = subject.program.transcription, subject.trial
    if not trial.status.is_success or tr.size + len(tr.rows) > _LARGEST:
        return None
    w = tr.iterate(trial.x, trial.u, trial.duration)
    free = ~_active(w, *(tr.bounds(subject.data)[name] for name in ("lbx", "ubx")))
    matrix = _matrix(subject, w, free)
    if not free.any() or not np.isfinite(matrix).all():
        return None
    scales = _balance(matrix)
    balanced = scales[:, None] * matrix * scales
    raw, after = float(np.linalg.cond(matrix)), float(np.linalg.cond(balanced))
    return Conditioning(raw, after, *_extremes(subject, scales[: free.sum()], free))


def _active(value: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        at_lower = np.isfinite(lower) & (value - lower <= _ACTIVE * (1.0 + np.abs(lower)))
        at_upper = np.isfinite(upper) & (upper - value <= _ACTIVE * (1.0 + np.abs(upper)))
    return at_lower | at_upper


def _matrix(subject: DiagnosedProblem, w: np.ndarray, free: np.ndarray) -> np.ndarray:
    """K, from the functions that the backend has built anyway."""
    tr = subject.program.transcription
    p, bounds = tr.data_vector(subject.data), tr.bounds(subject.data)
    nlp = subject.program.nlp.function
    slope = np.array(nlp.get_function("nlp_grad_f")(w, p)[1]).ravel()[free]
    g, jacobian = (np.array(a) for a in nlp.get_function("nlp_jac_g")(w, p))
    on = _active(g.ravel(), bounds["lbg"], bounds["ubg"])
    rows = jacobian[np.ix_(on, free)]
    weights = np.zeros(len(g))
    weights[on] = np.linalg.lstsq(rows.T, -slope, rcond=_DEPENDENT)[0]
    upper = np.array(nlp.get_function("nlp_hess_l")(w, p, 1.0, weights))[np.ix_(free, free)]
    hessian = upper + np.triu(upper, 1).T
    whole = np.block([[hessian, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    return without_traces(whole)


def _balance(matrix: np.ndarray) -> np.ndarray:
    """Return the diagonal that balances a symmetric matrix."""
    scales = np.ones(len(matrix))
    for _ in range(_ROUNDS):
        largest = np.abs(scales[:, None] * matrix * scales).max(axis=1)
        scales /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
    return scales


def _extremes(subject: DiagnosedProblem, scales: np.ndarray, free: np.ndarray) -> tuple[str, str]:
    """Return the names of the unknowns with the largest and the smallest scale."""
    tr, m = subject.program.transcription, subject.ocp.model
    time = ["final time"] if subject.ocp.has_free_time else []
    names = [*m.x_names, *time, *m.u_names]
    where = np.flatnonzero(free) % (tr.nz + m.nu)
    return names[where[scales.argmax()]], names[where[scales.argmin()]]
