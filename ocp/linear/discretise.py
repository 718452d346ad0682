"""From continuous to discrete time, exactly: zero-order hold and integrated cost."""

from dataclasses import replace

import casadi as ca
import numpy as np
from scipy.linalg import expm

from ocp.checks.arguments import check_instance, check_positive
from ocp.checks.errors import ProblemError, UnsupportedProblem
from ocp.linear.structure import Terms, read_terms
from ocp.problem.constraint import Constraint
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Parameter, Signal, Steps

# A horizon that is a multiple of dt up to this is one.
_MULTIPLE = 1e-9


def discretise(ocp: OCP, dt: float) -> OCP:
    r"""Return the discrete-time problem that is equal to a continuous one with held controls.

    .. math::

        x_{k+1} = e^{A\Delta t}x_k + \int_0^{\Delta t} e^{A\tau} d\tau\, (Bu_k + c_k), \qquad
        L_k = \int_0^{\Delta t} x'Qx + 2x'Su + u'Ru + 2q'x + 2r'u + \text{const}\; d\tau

    The cost is integrated along the true motion, not multiplied by dt, so it has a cross term
    even where the continuous one has none, and both problems cost the same. Both integrals come
    from matrix exponentials of (x, u, c), whose rate is M (x, u, c) [Van Loan 1978]. Bounds and
    constraints are carried over and hold at the samples only; between them they may be exceeded.

    Args:
        ocp: linear dynamics and quadratic cost with constant matrices. Parameters and held
            signals may enter the affine and linear terms.
        dt: step [s]; the horizon is a multiple of it, and so is the step of every signal.

    Raises:
        UnsupportedProblem: naming the term that is not linear or quadratic, or changes with time.
        ProblemError: if dt does not fit the horizon or a signal.
    """
    check_instance(ocp, OCP, "discretise: the problem")
    if ocp.model.is_discrete:
        raise ProblemError(f"{ocp.name}: the model is discrete already")
    if ocp.has_free_time:
        raise UnsupportedProblem(f"{ocp.name}: a free final time has no number of steps")
    for name in ocp.control_rates.names:
        raise UnsupportedProblem(
            f"{ocp.name}: the {name}: held controls jump, which has no rate in continuous time; "
            "discretise without it, then limit the change per step: "
            "replace(discrete, rates=(Rate(u, lower * dt, upper * dt, weight / dt),))"
        )
    check_positive(dt, f"{ocp.name}: dt [s]")
    ocp = ocp.explicit
    steps = _whole(ocp.duration / dt, f"{ocp.name}: the horizon of {ocp.duration:g} s", dt)
    terms = read_terms(ocp)
    _refuse_time(ocp, terms)
    after, cost = _one_step(ocp, terms, dt)
    m = ocp.model
    return replace(
        ocp,
        name=f"{ocp.name}, dt = {dt:g} s",
        model=replace(m, f=after, dt=dt),
        horizon=steps,
        running_cost=cost,
        constraints=tuple(_priced(c, dt) for c in ocp.constraints),
        parameters=tuple(_resampled(entry, steps) for entry in ocp.parameters),
    )


def _priced(c: Constraint, dt: float) -> Constraint:
    """Return a constraint whose soft price is one a step."""
    if c.soft is None or c.at != "path":
        return c
    return replace(c, soft=c.soft.per(1.0, 1.0 / dt))


def _one_step(ocp: OCP, terms: Terms, dt: float) -> tuple[ca.SX, ca.SX]:
    """Return state and cost after a step, from the flow of z = (x, u, c) and its integrals."""
    numbers = {name: _constant(ocp, terms, name) for name in ("A", "B", "Q", "S", "R")}
    n, m = ocp.model.nx, ocp.model.nu
    size = 2 * n + m
    rate, weight = np.zeros((size, size)), np.zeros((size, size))
    rate[:n] = np.hstack([numbers["A"], numbers["B"], np.eye(n)])
    both = np.hstack([numbers["Q"], numbers["S"]])
    weight[:n, : n + m] = both
    weight[n : n + m, : n + m] = np.hstack([numbers["S"].T, numbers["R"]])
    zero = np.zeros((size, size))
    double = expm(np.block([[-rate.T, weight], [zero, rate]]) * dt)
    flow = double[size:, size:]
    quadratic = flow.T @ double[:size, size:]
    linear = expm(np.block([[rate, np.eye(size)], [zero, zero]]) * dt)[:size, size:]
    z = ca.vertcat(ocp.model.x, ocp.model.u, terms.c)
    slope = ca.vertcat(terms.q, terms.r, ca.SX.zeros(n))
    cost = ca.bilin(ca.DM((quadratic + quadratic.T) / 2), z, z)
    cost += 2 * ca.dot(slope, ca.mtimes(ca.DM(linear), z)) + terms.constant * dt
    return ca.mtimes(ca.DM(flow[:n]), z), cost


def _constant(ocp: OCP, terms: Terms, name: str) -> np.ndarray:
    expression = getattr(terms, name)
    symbols = ca.symvar(expression)
    if symbols:
        raise UnsupportedProblem(
            f"{ocp.name}: {name} depends on {symbols[0]}, a matrix exponential needs numbers"
        )
    return np.array(ca.DM(expression))


def _refuse_time(ocp: OCP, terms: Terms) -> None:
    for what, parts in (("f", (terms.c,)), ("running_cost", (terms.q, terms.r, terms.constant))):
        stacked = ca.vertcat(*parts)
        if ca.depends_on(stacked, ocp.model.t):
            raise UnsupportedProblem(
                f"{ocp.name}: {what} depends on the time {ocp.model.t} between the samples; "
                "state it as a held signal"
            )
        for entry in ocp.parameters:
            if (
                isinstance(entry, Signal)
                and entry.hold != "held"
                and ca.depends_on(stacked, entry.symbol)
            ):
                raise UnsupportedProblem(
                    f"{ocp.name}: signal '{entry.name}' is linear between its samples in {what}; "
                    "hold it (hold='held')"
                )


def _resampled(entry: Parameter | Signal | Steps, steps: int) -> Parameter | Signal | Steps:
    """Return a signal with one sample per step; nothing is lost."""
    if not isinstance(entry, Signal) or len(entry.value) == steps + 1:
        return entry
    if entry.hold == "held" and steps % (len(entry.value) - 1):
        raise ProblemError(
            f"signal '{entry.name}' changes {len(entry.value) - 1} times in {steps} steps: "
            "its samples do not fall on the samples of the controls"
        )
    samples = entry.at(entry.value, np.linspace(0.0, 1.0, steps + 1), 1)
    return Signal(entry.name, entry.symbol, samples, entry.hold)


def _whole(ratio: float, what: str, dt: float) -> int:
    if ratio < 0.5 or abs(ratio - round(ratio)) > _MULTIPLE * ratio:
        raise ProblemError(f"{what} is no multiple of dt = {dt:g} s")
    return round(ratio)
