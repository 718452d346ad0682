"""The CasADi functions of a Newton step over all stages, and the names of their outputs.

``evaluate_stages``: costs, defects and derivatives; ``riccati_solve``: the Newton step as a
feedback law; ``trial_iterate``: the iterate that a share of the step leads to. Derivatives are
kept with the last stage first, the order of the Riccati recursion; all else runs forwards.
"""

from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp import OCP, Box, Integrator
from ocp.internal import Stage, compiled, stage_hessian
from solvers.direct.newton.active_bounds import control_units
from solvers.direct.newton.riccati_recursion import backwards, feedback_rollout, forwards


class StageEvaluation(NamedTuple):
    r"""Outputs of ``evaluate_stages``, in their order; nw = nx + nu.

    With defects c_k = F(x_k, u_k) - x_{k+1} and stage costs l the Lagrangian is

    .. math:: \sum_k l(x_k, u_k) + p_{k+1}' c_k + \varphi(x_N) - p_0' x_0.

    Attributes:
        jacobian: of F in (x, u), side by side, last stage first (nx, nw N).
        gradient: of the Lagrangian in (x, u), last stage first (nw, N).
        hessian: of the Lagrangian in (x, u), side by side, last stage first (nw, nw N).
        end_gradient: of the Lagrangian in x_N (nx, 1).
        end_hessian: of the Lagrangian in x_N (nx, nx).
        defects: c (nx, N).
        control_gradient: of the Lagrangian in u (nu, N).
        measures: the numbers of ``Measures`` (6, 1).
    """

    jacobian: np.ndarray
    gradient: np.ndarray
    hessian: np.ndarray
    end_gradient: np.ndarray
    end_hessian: np.ndarray
    defects: np.ndarray
    control_gradient: np.ndarray
    measures: np.ndarray


class Measures(NamedTuple):
    """What an iterate is worth.

    Attributes:
        cost: the sum of the stages' costs and the final one.
        defect_norm1: sum of abs(c).
        defect_norm2: Euclidean norm of c.
        gradient_norm: Euclidean norm of the Lagrangian's gradient in states and controls, the
            latter projected onto the bounds, see ``_projected_gradient``.
        largest_costate: largest abs(p).
        hessian_norm: largest element of H_uu and H_ux, to measure a shift by.
    """

    cost: float
    defect_norm1: float
    defect_norm2: float
    gradient_norm: float
    largest_costate: float
    hessian_norm: float


class RiccatiSolution(NamedTuple):
    """Outputs of ``riccati_solve``, in their order.

    Attributes:
        law: feedback law of every stage, see ``backwards``, side by side (nu + nx, (nx + 1) N).
        pivots: of every Q_uu among the free controls, relative to its diagonal (nu, N).
        du: step of the controls by the linear model (nu, N).
        clamped_gradient: gradient in the clamped controls after the step, 0 for free ones (nu, N).
        slopes: the numbers of ``StepSlopes`` (3, 1).
    """

    law: np.ndarray
    pivots: np.ndarray
    du: np.ndarray
    clamped_gradient: np.ndarray
    slopes: np.ndarray


class StepSlopes(NamedTuple):
    """What the linear model says of a step.

    Attributes:
        next_costate: largest abs(p) after the step.
        cost_slope: directional derivative of the cost.
        directional_curvature: second directional derivative of the (shifted) Lagrangian.
    """

    next_costate: float
    cost_slope: float
    directional_curvature: float


def evaluate_stages(ocp: OCP, n: int, integrator: Integrator, *, fast: bool) -> ca.Function:
    """Return the function of (x, u, costate, t, h, p0, p1, p_final) to a ``StageEvaluation``."""
    nu, s, last_first = ocp.model.nu, _symbols(ocp, n), _last_first(n)
    x, costate = s["x"], s["costate"]
    stage = stage_hessian(ocp, integrator)
    stage = compiled(stage) if fast else stage
    inputs = [x[:, :-1], *[s[name] for name in ("u", "t", "h", "p0", "p1")], costate[:, 1:]]
    after, cost, jacobian, gradient, hessian = stage.map(n)(
        *[each[:, last_first] for each in inputs]
    )
    defects = after[:, last_first] - x[:, 1:]
    gradient = gradient - ca.vertcat(costate[:, :-1][:, last_first], ca.MX.zeros(nu, n))
    end_cost, end_gradient, end_hessian = _end(ocp)(x[:, -1], s["t"][-1] + s["h"][-1], s["p_final"])
    end_gradient = end_gradient - costate[:, -1]
    outputs = {
        "jacobian": jacobian,
        "gradient": gradient,
        "hessian": hessian,
        "end_gradient": end_gradient,
        "end_hessian": end_hessian,
        "defects": defects,
        "control_gradient": gradient[ocp.model.nx :, last_first],
    }
    outputs["measures"] = _measures(ocp, s["u"], costate, ca.sum2(cost) + end_cost, outputs)
    names = ("x", "u", "costate", "t", "h", "p0", "p1", "p_final")
    results = _ordered(outputs, StageEvaluation._fields)
    return ca.Function("evaluate_stages", [s[name] for name in names], results)


def _measures(ocp: OCP, u: ca.MX, costate: ca.MX, cost: ca.MX, stages: dict[str, ca.MX]) -> ca.MX:
    """Return the numbers of ``Measures`` (6, 1) from the other outputs of ``evaluate_stages``."""
    nx, bounds = ocp.model.nx, ocp.control_bounds
    defects, projected = ca.vec(stages["defects"]), stages["control_gradient"]
    largest = ca.norm_inf(ca.vec(costate))
    if bounds.is_active:
        projected = _projected_gradient(u, projected, 1 + largest, bounds)
    gradient = [ca.vec(stages["gradient"][:nx, :]), ca.vec(projected), stages["end_gradient"]]
    measures = {
        "cost": cost,
        "defect_norm1": ca.norm_1(defects),
        # Norms of squares: CasADi's largest element ignores NaN.
        "defect_norm2": ca.norm_2(defects),
        "gradient_norm": ca.norm_2(ca.vertcat(*gradient)),
        "largest_costate": largest,
        "hessian_norm": ca.norm_inf(ca.vec(stages["hessian"][nx:, :])),
    }
    return ca.vertcat(*_ordered(measures, Measures._fields))


def riccati_solve(ocp: OCP, n: int, *, fast: bool) -> ca.Function:
    """Return the recursion: backwards for the law, forwards for the step of the linear model.

    Returns:
        the function of (jacobian, gradient, hessian, end_gradient, end_hessian, defects, costate,
        sigma, clamped, clamped_step), see ``StageEvaluation`` and ``backwards``, to a
        ``RiccatiSolution``.
    """
    nx, nu, s = ocp.model.nx, ocp.model.nu, _symbols(ocp, n)
    parts = [backwards(nx, nu), forwards(nx, nu)]
    back, run = map(compiled, parts) if fast else parts
    last_first, defects, costate = _last_first(n), s["defects"], s["costate"]
    start = ca.horzcat(s["end_hessian"], s["end_gradient"])
    stages = [s[name] for name in ("hessian", "jacobian", "gradient")]
    others = [s[name][:, last_first] for name in ("defects", "clamped", "clamped_step")]
    shift = ca.repmat(s["sigma"], 1, n)
    _, law, effect, pivots = back.mapaccum(n)(start, *stages, others[0], shift, *others[1:])
    in_order = [(nx + 1) * k + i for k in last_first for i in range(nx + 1)]
    law, effect = law[:, in_order], effect[:, in_order]
    dx, du, dcostate, clamped_gradient = run.mapaccum(n)(ca.MX.zeros(nx), law, effect)
    dx = ca.horzcat(ca.MX.zeros(nx), dx)
    dcostate = ca.horzcat(dcostate, s["end_hessian"] @ dx[:, -1] + s["end_gradient"])
    gradient = s["gradient"][:, last_first]
    along = ca.dot(gradient, ca.vertcat(dx[:, :-1], du)) + ca.dot(s["end_gradient"], dx[:, -1])
    slopes = {
        "next_costate": ca.norm_inf(ca.vec(costate + dcostate)),
        # From the equations of the step: it closes the defects of the linear model, and leaves a
        # gradient in the clamped controls only.
        "cost_slope": along + ca.dot(costate[:, 1:], defects),
        "directional_curvature": (
            ca.dot(dcostate[:, 1:], defects) - along + ca.dot(clamped_gradient, du)
        ),
    }
    outputs = {
        "law": law,
        "pivots": pivots[:, last_first],
        "du": du,
        "clamped_gradient": clamped_gradient,
        "slopes": ca.vertcat(*_ordered(slopes, StepSlopes._fields)),
    }
    names = ("jacobian", "gradient", "hessian", "end_gradient", "end_hessian", "defects", "costate")
    inputs = [s[name] for name in (*names, "sigma", "clamped", "clamped_step")]
    return ca.Function("riccati_solve", inputs, _ordered(outputs, RiccatiSolution._fields))


def trial_iterate(ocp: OCP, n: int, integrator: Integrator, *, fast: bool) -> ca.Function:
    """Return the roll-out of the model under the feedback law, see ``feedback_rollout``.

    Returns:
        the function of (x, u, costate, step_length, law, defects, t, h, p0, p1, p_final) to
        (x, u, costate).
    """
    s = _symbols(ocp, n)
    stage = feedback_rollout(Stage.of(ocp, integrator, held=True).step, ocp.control_bounds)
    run = (compiled(stage) if fast else stage).mapaccum(n)
    x, costate, length = s["x"], s["costate"], s["step_length"]
    data = [s[name] for name in ("t", "h", "p0", "p1")]
    along = (x[:, :-1], s["u"], costate[:, :-1], *data)
    after, u, before = run(x[:, 0], ca.repmat(length, 1, n), s["law"], s["defects"], *along)
    _, gradient, hessian = _end(ocp)(x[:, -1], s["t"][-1] + s["h"][-1], s["p_final"])
    newton = length * (gradient - costate[:, -1])
    last = costate[:, -1] + newton + hessian @ (after[:, -1] - x[:, -1])
    results = [ca.horzcat(x[:, 0], after), u, ca.horzcat(before, last)]
    names = ("x", "u", "costate", "step_length", "law", "defects", "t", "h", "p0", "p1", "p_final")
    return ca.Function("trial_iterate", [s[name] for name in names], results)


def _symbols(ocp: OCP, n: int) -> dict[str, ca.MX]:
    """Return the inputs of all three functions by name."""
    nx, nu, n_p = ocp.model.nx, ocp.model.nu, ocp.p.numel()
    nw = nx + nu
    shapes = {"x": (nx, n + 1), "u": (nu, n), "costate": (nx, n + 1)}
    shapes |= {"step_length": (1, 1), "law": (nw, (nx + 1) * n), "defects": (nx, n)}
    shapes |= {"jacobian": (nx, nw * n), "gradient": (nw, n), "hessian": (nw, nw * n)}
    shapes |= {"end_gradient": (nx, 1), "end_hessian": (nx, nx)}
    shapes |= {"sigma": (1, 1), "clamped": (nu, n), "clamped_step": (nu, n)}
    shapes |= {"t": (1, n), "h": (1, n), "p0": (n_p, n), "p1": (n_p, n), "p_final": (n_p, 1)}
    return {name: ca.MX.sym(name, *shape) for name, shape in shapes.items()}


def _ordered(outputs: dict[str, ca.MX], names: tuple[str, ...]) -> list[ca.MX]:
    """Return outputs in the order of their names."""
    return [outputs[name] for name in names]


def _last_first(n: int) -> list[int]:
    """Return the order of the recursion, which runs backwards."""
    return list(range(n - 1, -1, -1))


def _projected_gradient(u: ca.MX, gradient: ca.MX, scale: ca.MX, bounds: Box) -> ca.MX:
    r"""Return the gradient in the controls (nu, N) as far as the bounds allow a step against it.

    With the units e of ``control_units`` and the scale s = 1 + abs(p), to which gradients are
    relative,

    .. math:: s \; (u - \mathrm{clip}(u - e^2 g / s)) / e

    which is e g away from the bounds. The step is divided by s before it is clipped: no step is
    longer than the bounds are wide, and after the clipping a large s would make it vanish.
    """
    one, step = (ca.SX.sym(name, u.shape[0]) for name in ("u", "step"))
    unit = control_units(bounds)
    projected = (one - bounds.clip_expression(one - unit * step)) / unit
    projection = ca.Function("projection", [one, step], [projected]).map(u.shape[1])
    return scale * projection(u, ca.diag(unit) @ gradient / scale)


def _end(ocp: OCP) -> ca.Function:
    """Return the terminal cost with its first and second derivatives."""
    x, t, p = ocp.model.x, ocp.model.t, ocp.p
    hessian, gradient = ca.hessian(ca.SX(ocp.terminal_cost), x)
    outputs = [ca.densify(each) for each in (ocp.terminal_cost, gradient, hessian)]
    return ca.Function("end", [x, t, p], outputs)
