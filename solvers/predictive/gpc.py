"""Generalised predictive control: a control law for a transfer function with dead time."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from threading import Lock
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from ocp import Box, ProblemError, Status
from ocp.internal import check_instance, check_not_negative, check_positive, check_whole
from solvers.linear.qp.least_violation import least_violation
from solvers.linear.qp.qp_backends import QpBackend, qp_backend
from solvers.linear.qp.quadratic_program import QP
from solvers.predictive.carima_prediction import CarimaModel, CarimaPrediction, history
from solvers.predictive.diophantine import added, delayed

# A closed loop with a pole beyond this grows, or does not die out.
_STABLE = 1.0 - 1e-9
# A bound that is exceeded by less, relative to 1 + abs(bound), is met.
_MET = 1e-9
# An infeasible program misses its bounds by more than this, whatever is done.
_UNAVOIDABLE = 1e-7


@dataclass(frozen=True)
class GPC:
    r"""Predict with a CARIMA model, weigh increments, apply the first, start again.

    .. math::

        \min_{\Delta u} \; \sum_{j=N_1}^{N_2} (\hat y(t+j) - w(t+j))^2 +
        \lambda \sum_{i=0}^{N_u-1} \Delta u(t+i)^2

    Not a solver of an ``OCP`` but a control law; ``models.carima_ocp`` states the same problem
    as one. Without active bounds the law is :math:`\Delta u(t) = K (w - f)` (2.78), K the
    first row of :math:`(G'G + \lambda E)^{-1} G'` (2.77); with them it is a quadratic program.
    The model contains an integrator, so a constant load leaves no steady-state error.

    Source: thesis 2.2.2; [Camacho & Bordons 2007, chapter 4].

    Args:
        n2: last predicted output, N2 [steps]; the thesis' N is N2 - d.
        n1: first predicted output; default d + 1, the first that an increment reaches.
        nu: number of increments, after which the input is held; default N2 - d.
        weight: lambda.
        increment_bounds: on the increments.
        input_bounds: on the inputs.
        output_bounds: on the predicted outputs.
        backend: of the quadratic program, a name that ``LinearMPC`` takes.
        tolerance: largest accepted residual of the quadratic program.
    """

    n2: int = 10
    n1: int | None = None
    nu: int | None = None
    weight: float = 1.0
    increment_bounds: Box = field(default_factory=Box)
    input_bounds: Box = field(default_factory=Box)
    output_bounds: Box = field(default_factory=Box)
    backend: str = "osqp"
    tolerance: float = 1e-8

    def __post_init__(self) -> None:
        """Check the options."""
        for name in ("n2", "n1", "nu"):
            value = getattr(self, name)
            if value is not None or name == "n2":
                check_whole(value, f"GPC: {name} [steps]", least=0)
        check_positive(self.tolerance, "GPC: tolerance", below=1.0)
        check_not_negative(self.weight, "GPC: weight")
        for name in ("increment_bounds", "input_bounds", "output_bounds"):
            check_instance(getattr(self, name), Box, f"GPC: {name}")
            object.__setattr__(self, name, getattr(self, name).sized(1, f"GPC: {name}"))

    def build(self, model: CarimaModel) -> "GPCLaw":
        """Predict, and invert what does not change.

        Args:
            model: polynomials a, b, c by rising delay, and dead time: ``models.Carima``.

        Raises:
            ProblemError: if the horizons do not fit, if the increments are not determined,
                or if the weight is 0 where the plant's zeros then make the loop unstable.
        """
        check_instance(model, CarimaModel, "GPC: model")
        first = model.delay + 1
        n1 = first if self.n1 is None else self.n1
        nu = self.n2 - model.delay if self.nu is None else self.nu
        if self.n2 < first:
            raise ProblemError(
                f"GPC: n2 = {self.n2}, but with a dead time of {model.delay} steps the first "
                f"output that an increment reaches is {first} steps ahead"
            )
        if not 1 <= n1 <= self.n2 or not 1 <= nu <= self.n2 - model.delay:
            raise ProblemError(
                f"GPC: 1 <= n1 <= n2 and 1 <= nu <= n2 - d are needed, "
                f"not n1 = {n1}, n2 = {self.n2}, nu = {nu}, d = {model.delay}"
            )
        law = GPCLaw(
            self, CarimaPrediction(model, n1, self.n2, nu), qp_backend(self.backend, self.tolerance)
        )
        law.check()
        return law


@dataclass(frozen=True, eq=False)
class ControlMove:
    """One step of the law.

    Attributes:
        increment: of the input; 0 where the status is no success.
        status: how the optimisation ended.
        message: which bound, and how many steps ahead, where it failed.
        increments: the whole plan, (Nu,).
        outputs: the predicted outputs, (N2 - N1 + 1,).
    """

    increment: float
    status: Status
    message: str
    increments: np.ndarray
    outputs: np.ndarray


class _Plan(NamedTuple):
    """Increments (Nu,) of the quadratic program, and how sound they are."""

    increments: np.ndarray
    status: Status
    message: str


@dataclass(frozen=True, eq=False)
class GPCLaw:
    """The law for one plant.

    Attributes:
        options: horizons, weight and bounds.
        prediction: free and forced response.
        backend: of the quadratic program.
    """

    options: GPC
    prediction: CarimaPrediction
    backend: QpBackend
    # The backend starts from its last answer.
    _lock: Lock = field(default_factory=Lock, init=False, repr=False)

    def __reduce__(self) -> tuple[Callable[..., "GPCLaw"], tuple[GPC, CarimaModel]]:
        """Copy and pickle options and model; what the backend knows stays behind."""
        return GPC.build, (self.options, self.prediction.model)

    @cached_property
    def gains(self) -> np.ndarray:
        """(G'G + lambda E)^-1 G', (Nu, N2 - N1 + 1): the plan per unit of w - f (2.77)."""
        return np.linalg.solve(self._half_hessian, self.prediction.forced.T)

    @property
    def gain(self) -> np.ndarray:
        """K of 2.78, its first row."""
        return self.gains[0]

    @cached_property
    def poles(self) -> np.ndarray:
        """Poles of the closed loop without active bounds, for a plant that is the model."""
        p, model = self.prediction, self.prediction.model
        of_du, of_y = np.asarray(model.c, dtype=float), np.zeros(1)
        for gain, f, h in zip(self.gain, p.on_outputs, p.on_increments, strict=True):
            of_y, of_du = added(of_y, gain * f), added(of_du, gain * h)
        through = delayed(np.convolve(model.b, of_y), model.delay + 1)
        return np.roots(added(np.convolve(p.difference, of_du), through))

    def step(self, outputs: ArrayLike, inputs: ArrayLike, reference: ArrayLike) -> ControlMove:
        """Return the next increment of the input.

        Args:
            outputs: measured outputs, oldest first, y(t) last. With white noise (C = 1) the
                last na + 1 suffice, with coloured noise all help. Before the oldest the
                output counts as constant.
            inputs: past inputs, oldest first, u(t - 1) last; the last nb + d + 1 suffice.
            reference: w(t + 1) ... w(t + N2), or one number for all; more are ignored.

        Raises:
            ProblemError: if the reference is shorter than the horizon or a number not finite.
        """
        p = self.prediction
        free, last = p.free(outputs, inputs), float(history(inputs, "inputs")[-1])
        miss = self._reference(reference) - free
        plan = self.gains @ miss
        lower, upper = self._bounds(free, last)
        rows = self._matrix @ plan
        slack = _MET * (1.0 + np.abs(rows))
        status, message = Status.SOLVED, ""
        if np.any(rows < lower - slack) or np.any(rows > upper + slack):
            with self._lock:
                plan, status, message = self._constrained(miss, lower, upper)
        if status is Status.SOLVED:
            # Rounding must not leave the bounds of what is applied.
            low, high = self._first(last)
            plan = np.concatenate([[min(max(plan[0], low), high)], plan[1:]])
        return ControlMove(float(plan[0]), status, message, plan, p.forced @ plan + free)

    def check(self) -> None:
        """Raise ``ProblemError`` where the weight 0 does not do."""
        model, weight = self.prediction.model, self.options.weight
        if np.linalg.matrix_rank(self._half_hessian) < self.prediction.nu:
            raise ProblemError(
                f"GPC: weight = {weight} leaves the {self.prediction.nu} increments undetermined: "
                "give a weight, or fewer increments"
            )
        zeros = np.roots(model.b)
        outside = zeros[np.abs(zeros) > _STABLE]
        if weight == 0.0 and outside.size and np.abs(self.poles).max() > _STABLE:
            raise ProblemError(
                f"GPC: weight = 0 makes the loop unstable: it would cancel the plant's zero at "
                f"{np.real_if_close(outside[0]):.4g}, outside the unit circle; give a weight"
            )

    # -- pieces -----------------------------------------------------------------------------

    @cached_property
    def _half_hessian(self) -> np.ndarray:
        g = self.prediction.forced
        return g.T @ g + self.options.weight * np.eye(self.prediction.nu)

    def _reference(self, reference: ArrayLike) -> np.ndarray:
        w, n2 = history(reference, "reference"), self.prediction.n2
        if w.size == 1:
            return np.full(len(self.prediction.window), w[0])
        if w.size < n2:
            raise ProblemError(f"GPC: the reference has {w.size} entries, n2 = {n2} are needed")
        return w[self.prediction.n1 - 1 : n2]

    def _first(self, last: float) -> tuple[float, float]:
        """Bounds of the first increment."""
        du, u = self.options.increment_bounds, self.options.input_bounds
        low = max(np.asarray(du.lower)[0], np.asarray(u.lower)[0] - last)
        return low, min(np.asarray(du.upper)[0], np.asarray(u.upper)[0] - last)

    def _bounds(self, free: np.ndarray, last: float) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of the rows of ``_matrix``."""
        lower, upper = [], []
        for (_, box), shift in zip(self._blocks, (0.0, last, free), strict=True):
            lower.append(np.asarray(box.lower) - shift + np.zeros(self._counts[len(lower)]))
            upper.append(np.asarray(box.upper) - shift + np.zeros(self._counts[len(upper)]))
        return np.concatenate(lower), np.concatenate(upper)

    @property
    def _blocks(self) -> tuple[tuple[str, Box], ...]:
        o = self.options
        return (
            ("increment_bounds", o.increment_bounds),
            ("input_bounds", o.input_bounds),
            ("output_bounds", o.output_bounds),
        )

    @property
    def _counts(self) -> tuple[int, int, int]:
        nu = self.prediction.nu
        return nu, nu, len(self.prediction.window)

    @cached_property
    def _matrix(self) -> np.ndarray:
        """Increments, inputs and outputs for a plan, one row each."""
        nu = self.prediction.nu
        return np.vstack([np.eye(nu), np.tri(nu), self.prediction.forced])

    @cached_property
    def _program(self) -> QP:
        return QP.of(sp.csc_matrix(2.0 * self._half_hessian), sp.csc_matrix(self._matrix))

    def _constrained(self, miss: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> _Plan:
        gradient = -2.0 * self.prediction.forced.T @ miss
        qp = self._program.with_vectors(gradient, lower, upper)
        answer = self.backend.solve(qp)
        if answer.z is not None and max(answer.residuals) <= self.options.tolerance:
            return _Plan(answer.z, Status.SOLVED, "")
        still = np.zeros(self.prediction.nu)
        nu = self.prediction.nu
        _, excess = least_violation(qp, np.arange(2 * nu, len(lower)), len(lower))
        if excess.max() > _UNAVOIDABLE:
            name = self._name(int(excess.argmax()))
            said = f"{name} must be exceeded by {excess.max():.3g}"
            return _Plan(still, Status.INFEASIBLE, said)
        return _Plan(still, Status.FAILED, f"{self.options.backend} says {answer.word}")

    def _name(self, row: int) -> str:
        for (name, _), count in zip(self._blocks, self._counts, strict=True):
            if row < count:
                ahead = row + (self.prediction.n1 if name == "output_bounds" else 0)
                return f"{name}, {ahead} steps ahead,"
            row -= count
        return "a bound"
