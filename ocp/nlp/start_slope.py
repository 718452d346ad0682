"""The slope of the first stage in a fixed start, which may not be finite there."""

import casadi as ca

from ocp.integration.one_step import Integrator, Stage
from ocp.problem.ocp import OCP


def start_slope(ocp: OCP, integrator: Integrator) -> ca.Function:
    r"""Return the derivative of the first stage's share of the Lagrangian in x_0.

    .. math:: \ell_x + F_x' \lambda + c_x' \mu

    for cost l, end F and path constraints c of the first interval.

    Args:
        ocp: the problem.
        integrator: one-step method of the interval.

    Returns:
        a Function of the inputs of ``Stage.step``, lambda (nx,) and mu (m,).
    """
    step = Stage.of(ocp, integrator, held=True).step
    s = step.mx_in()
    x, u, t, _, p = s[:5]
    after, cost = step.call(s)
    path = ocp.functions.path(x, u, t, p)
    of_after, of_path = ca.MX.sym("of_after", ocp.model.nx), ca.MX.sym("of_path", path.numel())
    share = cost + ca.dot(of_after, after) + ca.dot(of_path, path)
    return ca.Function("start_slope", [*s, of_after, of_path], [ca.gradient(share, x)])


def step_with_fixed_start(function: ca.Function, n: int, x0: ca.MX, inputs: list[ca.MX]) -> list:
    """Map a function of (x, ...) over n stages, the first of them from x0 and without slope in it.

    Args:
        function: of a stage.
        n: number of stages.
        x0: start (nx,).
        inputs: one column a stage; the first column of the states is not used.

    Returns:
        the outputs, one column a stage.
    """
    flags = [name != "x" for name in function.name_in()]
    # Of SX, the zero seeds of the start are dropped; in MX they would multiply its slopes.
    if function.is_a("SXFunction"):
        sx = function.sx_in()
        first = ca.Function("first_stage", sx, function.call(sx), {"is_diff_in": flags})
    else:
        mx = function.mx_in()
        first = ca.Function("first_stage", mx, function.call(mx), {"is_diff_in": flags})
    values = first.call([x0, *(entry[:, 0] for entry in inputs[1:])])
    # With structural zeros a backend that detects the stages would not find x_0.
    values = [v + ca.MX(ca.DM.zeros(v.numel(), x0.numel())) @ inputs[0][:, 0] for v in values]
    if n == 1:
        return values
    later = function.map(n - 1).call([entry[:, 1:] for entry in inputs])
    return [ca.horzcat(a, b) for a, b in zip(values, later, strict=True)]
