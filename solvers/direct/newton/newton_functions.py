"""The functions of a Newton step over all stages: evaluate, solve, go."""

import casadi as ca

from ocp import OCP, Box, Integrator
from ocp.internal import Stage, compiled, stage_hessian
from solvers.direct.newton.riccati_recursion import backwards, feedback_rollout, forwards, units


def _symbols(ocp: OCP, n: int) -> dict[str, ca.MX]:
    nx, nu, n_p = ocp.model.nx, ocp.model.nu, ocp.p.numel()
    nw = nx + nu
    shapes = {"x": (nx, n + 1), "u": (nu, n), "costate": (nx, n + 1)}
    shapes |= {"share": (1, 1), "law": (nw, (nx + 1) * n), "gap": (nx, n)}
    shapes |= {"jacobian": (nx, nw * n), "slope": (nw, n), "hessian": (nw, nw * n)}
    shapes |= {"end_slope": (nx, 1), "end_hessian": (nx, nx)}
    shapes |= {"sigma": (1, 1), "clamped": (nu, n), "move": (nu, n)}
    shapes |= {"t": (1, n), "h": (1, n), "p0": (n_p, n), "p1": (n_p, n), "p_final": (n_p, 1)}
    return {name: ca.MX.sym(name, *shape) for name, shape in shapes.items()}


def _last_first(n: int) -> list[int]:
    """Return the order of the recursion, which runs backwards."""
    return list(range(n - 1, -1, -1))


def evaluate_stages(ocp: OCP, n: int, integrator: Integrator, *, fast: bool) -> ca.Function:
    """Return the stages' derivatives and what a ``View`` says of an iterate.

    Returns:
        a function of (x, u, costate, t, h, p0, p1, p_final) that returns Jacobians, slopes and
        Hessians of the stages side by side, the last stage first; slope and Hessian of the end;
        gaps; slopes in the controls; and the numbers of a ``View``.
    """
    nu, s = ocp.model.nu, _symbols(ocp, n)
    x, u, costate, backwards_in_time = s["x"], s["u"], s["costate"], _last_first(n)
    stage = stage_hessian(ocp, integrator)
    stage = compiled(stage) if fast else stage
    inputs = [x[:, :-1], *[s[name] for name in ("u", "t", "h", "p0", "p1")], costate[:, 1:]]
    after, cost, jacobian, slope, hessian = stage.map(n)(
        *[each[:, backwards_in_time] for each in inputs]
    )
    gap = after[:, backwards_in_time] - x[:, 1:]
    slope = slope - ca.vertcat(costate[:, :-1][:, backwards_in_time], ca.MX.zeros(nu, n))
    end_cost, end_slope, end_hessian = _end(ocp)(x[:, -1], s["t"][-1] + s["h"][-1], s["p_final"])
    end_slope = end_slope - costate[:, -1]
    pull = slope[ocp.model.nx :, backwards_in_time]
    largest = ca.norm_inf(ca.vec(costate))
    bounds = ocp.control_bounds
    room = _room(u, pull, 1 + largest, bounds) if bounds.is_active else pull
    numbers = [
        ca.sum2(cost) + end_cost,
        ca.norm_1(ca.vec(gap)),
        # Norms of squares: the largest number of CasADi does not see NaN.
        ca.norm_2(ca.vec(gap)),
        ca.norm_2(ca.vertcat(ca.vec(slope[: ocp.model.nx, :]), ca.vec(room), end_slope)),
        largest,
        ca.norm_inf(ca.vec(hessian[ocp.model.nx :, :])),
    ]
    names = ("x", "u", "costate", "t", "h", "p0", "p1", "p_final")
    derivatives = [jacobian, slope, hessian, end_slope, end_hessian]
    results = [*derivatives, gap, pull, ca.vertcat(*numbers)]
    return ca.Function("look", [s[name] for name in names], results)


def riccati_solve(ocp: OCP, n: int, *, fast: bool) -> ca.Function:
    """Return the recursion: backwards for the law, forwards for the step of the linear model.

    Returns:
        a function of (the derivatives of ``look``, gaps, costate, sigma, clamped, move), see
        ``backwards``, that returns the laws side by side, the pivots, du, the slopes left to the
        clamped controls, and the numbers of a ``Step``.
    """
    nx, nu, s = ocp.model.nx, ocp.model.nu, _symbols(ocp, n)
    parts = [backwards(nx, nu), forwards(nx, nu)]
    back, run = map(compiled, parts) if fast else parts
    backwards_in_time, gap, costate = _last_first(n), s["gap"], s["costate"]
    start = ca.horzcat(s["end_hessian"], s["end_slope"])
    stages = [s[name] for name in ("hessian", "jacobian", "slope")]
    others = [each[:, backwards_in_time] for each in (gap, s["clamped"], s["move"])]
    shift = ca.repmat(s["sigma"], 1, n)
    _, law, effect, pivots = back.mapaccum(n)(start, *stages, others[0], shift, *others[1:])
    in_order = [(nx + 1) * k + i for k in backwards_in_time for i in range(nx + 1)]
    law, effect = law[:, in_order], effect[:, in_order]
    dx, du, dcostate, left = run.mapaccum(n)(ca.MX.zeros(nx), law, effect)
    dx = ca.horzcat(ca.MX.zeros(nx), dx)
    dcostate = ca.horzcat(dcostate, s["end_hessian"] @ dx[:, -1] + s["end_slope"])
    slope = s["slope"][:, backwards_in_time]
    along = ca.dot(slope, ca.vertcat(dx[:, :-1], du)) + ca.dot(s["end_slope"], dx[:, -1])
    numbers = [
        ca.norm_inf(ca.vec(costate + dcostate)),
        # From the step's own equations: the gaps close linearly, and of the slopes only those
        # of clamped controls are left.
        along + ca.dot(costate[:, 1:], gap),
        ca.dot(dcostate[:, 1:], gap) - along + ca.dot(left, du),
    ]
    names = ("jacobian", "slope", "hessian", "end_slope", "end_hessian", "gap", "costate")
    inputs = [s[name] for name in (*names, "sigma", "clamped", "move")]
    results = [law, pivots[:, backwards_in_time], du, left, ca.vertcat(*numbers)]
    return ca.Function("sweep", inputs, results)


def trial_iterate(ocp: OCP, n: int, integrator: Integrator, *, fast: bool) -> ca.Function:
    """Return the law followed by the model: see ``NewtonStep.go``."""
    s = _symbols(ocp, n)
    stage = feedback_rollout(Stage.of(ocp, integrator, held=True).step, ocp.control_bounds)
    run = (compiled(stage) if fast else stage).mapaccum(n)
    x, costate, share = s["x"], s["costate"], s["share"]
    data = [s[name] for name in ("t", "h", "p0", "p1")]
    along = (x[:, :-1], s["u"], costate[:, :-1], *data)
    after, u, before = run(x[:, 0], ca.repmat(share, 1, n), s["law"], s["gap"], *along)
    _, slope, hessian = _end(ocp)(x[:, -1], s["t"][-1] + s["h"][-1], s["p_final"])
    last = costate[:, -1] + share * (slope - costate[:, -1]) + hessian @ (after[:, -1] - x[:, -1])
    results = [ca.horzcat(x[:, 0], after), u, ca.horzcat(before, last)]
    names = ("x", "u", "costate", "share", "law", "gap", "t", "h", "p0", "p1", "p_final")
    return ca.Function("go", [s[name] for name in names], results)


def _room(u: ca.MX, slope: ca.MX, size: ca.MX, bounds: Box) -> ca.MX:
    r"""Return the slopes in the controls (nu, N) as far as the bounds leave room.

    With the units e of ``units``, and the size s = 1 + abs(p) that slopes are relative to,

    .. math:: s \; (u - \mathrm{clip}(u - e^2 g / s)) / e

    which is e g away from the bounds. The step has to be made relative before it is clipped: no
    step is longer than the bounds are wide, and then relative to a large s that is nothing.
    """
    one, step = (ca.SX.sym(name, u.shape[0]) for name in ("u", "step"))
    unit = units(bounds)
    room = (one - bounds.clip_expression(one - unit * step)) / unit
    nearest = ca.Function("room", [one, step], [room]).map(u.shape[1])
    return size * nearest(u, ca.diag(unit) @ slope / size)


def _end(ocp: OCP) -> ca.Function:
    """Return the terminal cost with its first and second derivatives."""
    x, t, p = ocp.model.x, ocp.model.t, ocp.p
    hessian, gradient = ca.hessian(ca.SX(ocp.terminal_cost), x)
    outputs = [ca.densify(each) for each in (ocp.terminal_cost, gradient, hessian)]
    return ca.Function("end", [x, t, p], outputs)
