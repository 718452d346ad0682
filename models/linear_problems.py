"""Quadratic problems of linear plants: regulators, tracking, references, the thesis' examples."""

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import vector
from models.linear import LinearPlant, mass_spring_damper, matrix
from ocp import OCP, Box, ProblemError, Signal
from ocp.internal import check_instance, check_positive, check_whole

# More asymmetry of a weight than this, relative to its largest entry, is no slip of rounding.
_SYMMETRIC = 1e-12


def lq_regulator(
    plant: LinearPlant,
    *,
    Q: ArrayLike,
    R: ArrayLike,
    P: ArrayLike = 0.0,
    x0: ArrayLike,
    horizon: float,
    control_bounds: Box | None = None,
    state_bounds: Box | None = None,
) -> OCP:
    r"""Return the regulator problem of a plant.

    .. math:: \min \; x_N'Px_N + \sum_{k=0}^{N-1} x_k'Qx_k + u_k'Ru_k

    Source: thesis (2.1) to (2.3); of a continuous plant the cost is integrated.

    Args:
        plant: discrete or continuous.
        Q: state weight (n, n), its diagonal (n,), or one number for all.
        R: control weight, likewise; positive definite.
        P: terminal weight, likewise.
        x0: start (n,).
        horizon: number of steps, or duration [s] of a continuous problem.
        control_bounds: box around the controls.
        state_bounds: box around the states.

    Raises:
        ProblemError: if a weight has a wrong size, is not symmetric or not (semi-)definite.
    """
    check_instance(plant, LinearPlant, "lq_regulator: plant")
    return _problem(plant, ca.SX.zeros(len(plant.A)), (), Q, R, P, x0, horizon,
                    (control_bounds, state_bounds))  # fmt: skip


def tracking_ocp(
    plant: LinearPlant,
    reference: ArrayLike,
    *,
    Q: ArrayLike,
    R: ArrayLike,
    P: ArrayLike = 0.0,
    x0: ArrayLike,
    horizon: float,
    control_bounds: Box | None = None,
    state_bounds: Box | None = None,
) -> OCP:
    r"""Return the problem of following a reference w, a signal called ``"reference"``.

    .. math:: \min \; (x_N - w_N)'P(x_N - w_N)
              + \sum_{k=0}^{N-1} (x_k - w_k)'Q(x_k - w_k) + u_k'Ru_k

    Source: thesis (2.14). Arguments and errors as ``lq_regulator``.

    Args:
        plant: discrete or continuous.
        reference: w at the nodes, (N + 1, n).
        Q: state weight.
        R: control weight.
        P: terminal weight.
        x0: start (n,).
        horizon: number of steps, or duration [s].
        control_bounds: box around the controls.
        state_bounds: box around the states.
    """
    check_instance(plant, LinearPlant, "tracking_ocp: plant")
    w = ca.vertcat(*[ca.SX.sym(f"reference of {name}") for name in plant.x_names])
    signals = (Signal("reference", w, reference),)
    return _problem(plant, w, signals, Q, R, P, x0, horizon, (control_bounds, state_bounds))


def sinusoid(
    t: ArrayLike, *, amplitude: float = 3.0, period: float = 4.0, moving: bool = True
) -> np.ndarray:
    """Return position amplitude sin(2 pi t / period) and its velocity, (len(t), 2).

    Args:
        t: times [s].
        amplitude: of the position.
        period: [s].
        moving: False: the velocity of the reference is zero throughout.
    """
    rate = 2.0 * np.pi / check_positive(period, "sinusoid: period")
    phase = rate * vector(t, np.size(t), "sinusoid: t")
    velocity = amplitude * rate * np.cos(phase) * float(moving)
    return np.stack([amplitude * np.sin(phase), velocity], axis=1)


def step_reference(t: ArrayLike, value: Sequence[float], *, at: float = 0.0) -> np.ndarray:
    """Return zero before a time and a value from it on, (len(t), n).

    Args:
        t: times [s].
        value: (n,).
        at: when it steps [s].
    """
    times, after = vector(t, np.size(t), "step: t"), vector(value, np.size(value), "step: value")
    return np.where(times[:, None] >= at - 1e-9, after, 0.0)


def thesis_regulator(plant: LinearPlant, steps: int) -> OCP:
    """Return the problem of section 2.1.4: weights (2.55), x0 = (1, 1, 1)."""
    return lq_regulator(plant, Q=100.0, R=500.0, P=10.0, x0=np.ones(3), horizon=steps)


def thesis_tracking(steps: int, *, dt: float = 0.05, moving: bool = True) -> OCP:
    """Return the constrained tracking problem of section 2.2.3: (2.92) to (2.94).

    The thesis does not give the sinusoid; 3 m in 4 s exceeds the bound of 2 m.

    Args:
        steps: horizon N.
        dt: step [s].
        moving: whether the reference has the velocity of the sinusoid, or none.
    """
    check_whole(steps, "thesis_tracking: steps")
    check_positive(dt, "thesis_tracking: dt [s]")
    return tracking_ocp(
        mass_spring_damper().sampled(dt),
        sinusoid(dt * np.arange(steps + 1), moving=moving),
        Q=[100.0, 10.0],
        R=0.5,
        P=100.0,
        x0=np.zeros(2),
        horizon=steps,
        control_bounds=Box(-40.0, 40.0),
        state_bounds=Box([-2.0, -np.inf], [2.0, np.inf]),
    )


def weight(values: ArrayLike, size: int, what: str, *, definite: bool = False) -> np.ndarray:
    """Return a symmetric (semi-)definite weight (size, size) of a matrix, a diagonal or a number.

    Raises:
        ProblemError: naming the weight, and its eigenvalue where that is the reason.
    """
    if np.ndim(values) < 2:
        given = np.full(size, values) if np.ndim(values) == 0 else values
        result = np.diag(vector(given, size, what))
    else:
        result = matrix(values, (size, size), what)
    scale = np.abs(result).max()
    if np.abs(result - result.T).max() > _SYMMETRIC * scale:
        raise ProblemError(f"{what} is not symmetric")
    least = float(np.linalg.eigvalsh(result)[0])
    if least < -1e-10 * scale or (definite and least <= 1e-10 * scale):
        kind = "definite" if definite else "semi-definite"
        raise ProblemError(f"{what} is not positive {kind}: it has the eigenvalue {least:.6g}")
    return result


def _problem(
    plant: LinearPlant,
    w: ca.SX,
    signals: tuple[Signal, ...],
    q: ArrayLike,
    r: ArrayLike,
    p: ArrayLike,
    x0: ArrayLike,
    horizon: float,
    boxes: tuple[Box | None, Box | None],
) -> OCP:
    model, error = plant.model, plant.model.x - w
    weights = [
        ca.sparsify(ca.DM(weight(given, size, f"{plant.name}: {label}", definite=label == "R")))
        for label, given, size in (("Q", q, model.nx), ("R", r, model.nu), ("P", p, model.nx))
    ]
    return OCP(
        name=f"{plant.name}, {'tracking' if signals else 'regulator'}",
        model=model,
        x0=x0,
        horizon=horizon,
        running_cost=ca.bilin(weights[0], error, error) + ca.bilin(weights[1], model.u, model.u),
        terminal_cost=ca.bilin(weights[2], error, error),
        control_bounds=boxes[0] or Box(),
        state_bounds=boxes[1] or Box(),
        parameters=signals,
    )
