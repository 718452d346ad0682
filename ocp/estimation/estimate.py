r"""How well data determine what was estimated: the covariance of a least squares estimate.

With the residuals r = (h - y) / sigma, their number M, and their derivatives in the n constants,

.. math:: C = s^2 (r_\theta' r_\theta)^{-1}, \qquad s^2 = 1 \;\text{ or }\; \frac{r'r}{M - n} ,

the inverse of Fisher's information for errors that are independent and normal, to first order in
them [Bard 1974].
"""

from dataclasses import dataclass

import numpy as np

from ocp.checks.arguments import check_flag, check_instance
from ocp.checks.errors import ProblemError, UnsupportedProblem
from ocp.checks.rich_text import html_of
from ocp.estimation.sensitivities import Estimated, residual_slopes
from ocp.referee.delayed_controls import with_acting_controls
from ocp.solution.solution import Solution

# Singular values of the scaled derivatives below this share of the largest are rounding.
_BLIND = 1e-10
# Constants whose part in what cannot be told apart is smaller are not named.
_NAMED = 0.1


@dataclass(frozen=True, eq=False)
class Estimate:
    """What was estimated, and how well data determine it.

    Attributes:
        names: of the constants, and of free starts as ``x(t0)``, (n,).
        values: (n,).
        covariance: of the values (n, n); rows and columns of what a bound holds are 0.
        residuals: (h - y) / sigma by name of the measurement, (K, m); NaN where nothing was
            measured.
        degrees_of_freedom: number of measured values less that of estimated ones.
        variance: s^2, the factor on every sigma^2: 1 where the sigmas are known.
        held: names of those that a bound holds.
    """

    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    residuals: dict[str, np.ndarray]
    degrees_of_freedom: int
    variance: float
    held: tuple[str, ...]

    @property
    def standard_errors(self) -> np.ndarray:
        """Standard deviations of the values, (n,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> np.ndarray:
        """Correlation of the values (n, n); 0 with what a bound holds."""
        errors = np.where(self.standard_errors > 0.0, self.standard_errors, np.inf)
        return self.covariance / errors / errors[:, None]

    def __repr__(self) -> str:
        """Return all values in one line."""
        each = zip(self.names, self.values, self.standard_errors, strict=True)
        return f"<Estimate: {', '.join(f'{n} = {v:.4g} +- {e:.1g}' for n, v, e in each)}>"

    def _repr_html_(self) -> str:
        """Return the values with their errors, for a notebook."""
        return html_of("Estimate", str(self))

    def __str__(self) -> str:
        """Return one line for each value, with its standard error."""
        each = zip(self.names, self.values, self.standard_errors, strict=True)
        return "\n".join(
            f"{name} = {value:.6g}" + (", at its bound" if name in self.held else f" +- {e:.2g}")
            for name, value, e in each
        )


def estimate(solution: Solution, *, sigma_is_known: bool = True) -> Estimate:
    """Return what a solution of a problem with data has estimated, and its covariance.

    Controls count as given, and costs beside the data as no knowledge. Derivatives are exact,
    along the referee's trajectory.

    Args:
        solution: of a problem with ``data``, and unknown constants or a free start.
        sigma_is_known: whether the sigmas of the measurements are standard deviations; False: only
            their ratios are known, and their size is estimated from the residuals.

    Raises:
        ProblemError: where there are no data, nothing is estimated, or the data do not tell
            constants apart, naming these.
        UnsupportedProblem: for constraints that tie constants or starts, and stiff dynamics.
    """
    check_instance(solution, Solution, "estimate: solution")
    check_flag(sigma_is_known, "estimate: sigma_is_known")
    _check(solution)
    acting = with_acting_controls(solution)
    estimated = Estimated.of(acting)
    residuals, slopes = residual_slopes(acting, estimated)
    free = np.flatnonzero(~estimated.is_held)
    freedom, name = len(residuals) - len(free), solution.problem.name
    if freedom < 0 or not (sigma_is_known or freedom):
        raise ProblemError(f"{name}: {len(residuals)} values measured, {len(free)} estimated")
    variance = 1.0 if sigma_is_known else float(residuals @ residuals) / freedom
    covariance = np.zeros((len(estimated.names),) * 2)
    names = tuple(estimated.names[i] for i in free)
    covariance[np.ix_(free, free)] = variance * _inverse(slopes[:, free], names, name)
    return Estimate(
        names=estimated.names,
        values=estimated.values,
        covariance=covariance,
        residuals=solution.residuals,
        degrees_of_freedom=freedom,
        variance=variance,
        held=tuple(np.array(estimated.names)[estimated.is_held].tolist()),
    )


def _check(solution: Solution) -> None:
    ocp = solution.problem
    if not ocp.data:
        raise ProblemError(f"{ocp.name}: estimate: it has no data")
    if not (ocp.unknowns or ocp.has_free_start):
        raise ProblemError(
            f"{ocp.name}: estimate: it has neither unknown constants nor a free start"
        )
    for c in ocp.constraints:
        if c.at != "path":
            raise UnsupportedProblem(
                f"{ocp.name}: estimate: the {c.at} constraint '{c.name}' ties what is estimated, "
                "and the covariance here knows of no ties"
            )
    if ocp.refers_to_start:
        raise UnsupportedProblem(f"{ocp.name}: estimate: a term contains the state at the start")


def _inverse(slopes: np.ndarray, names: tuple[str, ...], name: str) -> np.ndarray:
    """Return (A'A)^-1 of derivatives A (M, n) in these constants."""
    if not names:  # all of them are held by their bounds
        return np.empty((0, 0))
    sizes = np.linalg.norm(slopes, axis=0)
    if not sizes.all():
        raise ProblemError(f"{name}: estimate: no data depend on {names[int(sizes.argmin())]}")
    _, singular, directions = np.linalg.svd(slopes / sizes, full_matrices=False)
    if len(singular) < len(names) or singular[-1] <= _BLIND * singular[0]:
        blind = np.abs(directions[-1]) > _NAMED
        said = ", ".join(n for n, is_part in zip(names, blind, strict=True) if is_part)
        raise ProblemError(f"{name}: estimate: the data do not tell {said} apart: fix one of them")
    root = directions.T / singular / sizes[:, None]
    return root @ root.T
