"""A job as JSON: sizes, bounds, and the functions as tapes and as C."""

from typing import Any

import casadi as ca
import numpy as np

from benchmarks.peers.job import Job
from benchmarks.peers.tape import tape_of
from ocp import RK4, UnsupportedProblem, minimum_principle
from ocp.internal import Stage


def exported(job: Job, setting: str) -> dict[str, Any]:
    """Return what a peer's script is told of a job.

    Functions of (x, u, p), where p is time and parameters at the node:

    * ``stage``: state and cost after one interval under a held control, by RK4;
    * ``rate``: dx/dt and running cost, None in discrete time;
    * ``terminal``: of (x, p), the terminal cost;
    * ``extremal``: of (x and costate, p), their rates and the minimising control, where the
      minimum principle determines it, else None, and ``why_no_extremal``;
    * ``c``: source of ``stage`` and ``terminal`` and of their derivatives, for those who take
      neither expressions nor tapes.

    Args:
        job: what to export.
        setting: of the peer.
    """
    ocp = job.ocp
    stage, terminal = _stage(job), _terminal(job)
    extremal, why = _extremal(job)
    bounds = {
        f"{what}_{side}": np.asarray(getattr(box, side)).tolist()
        for what, box in (("u", ocp.control_bounds), ("x", ocp.state_bounds))
        for side in ("lower", "upper")
    }
    linear = {k: np.asarray(v, dtype=float).tolist() for k, v in (job.linear or {}).items()}
    return {
        "name": job.name,
        "setting": setting,
        "nx": ocp.model.nx,
        "nu": ocp.model.nu,
        "np": 1 + ocp.p.numel(),
        "N": job.intervals,
        "interval": job.interval,
        "tolerance": job.tolerance,
        **bounds,
        "x_end": job.end_state,
        "stage": tape_of(stage),
        "rate": None if ocp.model.is_discrete else tape_of(_rate(job)),
        "terminal": tape_of(terminal),
        "extremal": extremal,
        "why_no_extremal": why,
        "linear": linear or None,
        "c": _c_code(stage, terminal),
    }


def _symbols(job: Job) -> list[ca.SX]:
    m = job.ocp.model
    sizes = {"x": m.nx, "u": m.nu, "p": 1 + job.ocp.p.numel()}
    return [ca.SX.sym(name, size) for name, size in sizes.items()]


def _stage(job: Job) -> ca.Function:
    x, u, p = _symbols(job)
    step = Stage.of(job.ocp, RK4(), held=True).step
    return ca.Function("stage", [x, u, p], [*step(x, u, p[0], job.interval, p[1:], p[1:])])


def _rate(job: Job) -> ca.Function:
    x, u, p = _symbols(job)
    f, now = job.ocp.functions, (x, u, p[0], p[1:])
    return ca.Function("rate", [x, u, p], [f.rate(*now), f.running_cost(*now)])


def _terminal(job: Job) -> ca.Function:
    x, _, p = _symbols(job)
    return ca.Function("terminal", [x, p], [job.ocp.functions.terminal_cost(x, p[0], p[1:])])


def _extremal(job: Job) -> tuple[dict | None, str]:
    try:
        conditions = minimum_principle(job.ocp)
    except UnsupportedProblem as reason:
        return None, str(reason)
    if not conditions.flow.is_a("SXFunction"):
        return None, "the minimising control has no closed form"
    x, _, p = _symbols(job)
    costate = ca.SX.sym("costate", job.ocp.model.nx)
    z = ca.vertcat(x, costate)
    rates = conditions.flow(z, p[0], p[1:])
    u = conditions.control(x, costate, p[0], p[1:])
    slope = job.ocp.functions.terminal_gradient(x, p[0], p[1:])
    return {
        "flow": tape_of(ca.Function("flow", [z, p], [rates, u])),
        "end": tape_of(ca.Function("end", [x, p], [slope])),
    }, ""


def _c_code(stage: ca.Function, terminal: ca.Function) -> str:
    """C of both functions and of their derivatives, all dense.

    ``stage_slopes`` has the second derivatives of the cost, ``stage_bend`` those of the state
    after the interval, weighted.
    """
    x, u, p = stage.sx_in()
    after, cost = stage(x, u, p)
    nx = x.numel()
    gradient = ca.gradient(cost, ca.vertcat(x, u))
    slopes = [ca.jacobian(after, x), ca.jacobian(after, u), gradient[:nx], gradient[nx:]]
    weights = ca.SX.sym("weights", nx)
    end = terminal(x, p)
    end_hess, end_gradient = ca.hessian(end, x)
    functions = (
        ca.Function("stage", [x, u, p], _dense([after, cost])),
        ca.Function("stage_slopes", [x, u, p], _dense([*slopes, *_curvatures(cost, x, u)])),
        ca.Function(
            "stage_bend", [x, u, p, weights], _dense(_curvatures(ca.dot(weights, after), x, u))
        ),
        ca.Function("terminal", [x, p], _dense([end])),
        ca.Function("terminal_slopes", [x, p], _dense([end_gradient, end_hess])),
    )
    generator = ca.CodeGenerator("job")
    for function in functions:
        generator.add(function)
    return generator.dump()


def _curvatures(value: ca.SX, x: ca.SX, u: ca.SX) -> list[ca.SX]:
    """Second derivatives of a number by (x, x), (x, u), (u, u)."""
    hess, nx = ca.hessian(value, ca.vertcat(x, u))[0], x.numel()
    return [hess[:nx, :nx], hess[:nx, nx:], hess[nx:, nx:]]


def _dense(expressions: list[ca.SX]) -> list[ca.SX]:
    return [ca.densify(ca.cse(e)) for e in expressions]
