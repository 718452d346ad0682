"""The step of a stage that brings its derivatives along, put together from those of one slope."""

import casadi as ca
import numpy as np

from ocp.checks.arguments import check_instance
from ocp.integration.one_step import Integrator, Stage
from ocp.integration.stage_tape import StageInputs, StageTape
from ocp.problem.ocp import OCP

# A matrix as its blocks, by the names of what is differentiated, and along what.
_Blocks = dict[tuple[str, str], ca.MX]


def differentiable_step(ocp: OCP, integrator: Integrator) -> ca.Function:
    """Return ``Stage.step`` for a held control, whose derivatives CasADi need not write out.

    Who differentiates it with CasADi, twice at most, along state and control (and t and h where
    the final time is free), is given the Jacobian and the Jacobian of the adjoint made by
    ``StageTape``: but for rounding the numbers of ``Stage.step``, with the same sparsity. The
    second derivatives of a slope, which are most of the code, are written once, however many
    slopes and substeps there are. All other inputs count as constants.

    Args:
        ocp: the problem.
        integrator: one-step method.
    """
    check_instance(ocp, OCP, "differentiable_step: the problem")
    step = Stage.of(ocp, integrator, held=True).step
    along = ["x", "u0", "t", "h"] if ocp.has_free_time else ["x", "u0"]
    step = _again(step, {"is_diff_in": [name in along for name in step.name_in()]})
    adjoint = step.reverse(1)
    s = {name: ca.MX.sym(name, adjoint.sparsity_in(name)) for name in adjoint.name_in()}
    given = StageInputs(*[s[name] for name in ("x", "u0", "t", "h", "p0", "p1")])
    tape = StageTape.of(ocp, integrator, given, timed=ocp.has_free_time)
    ends = np.cumsum([0, *(s[name].numel() for name in along)])
    first = _blocks(
        {"x_next": tape.end.state_jacobian, "cost": tape.end.cost_gradient}, along, ends
    )
    rows = ca.vertsplit(tape.hessian(s["adj_x_next"], s["adj_cost"]), ends)
    second = _blocks({f"adj_{of}": row for of, row in zip(along, rows, strict=True)}, along, ends)
    second |= {(f"adj_{name}", f"adj_{of}"): block.T for (of, name), block in first.items()}
    adjoint = _bringing(adjoint, _jacobian(adjoint, second, s))
    return _bringing(step, _jacobian(step, first, s), adjoint)


def _blocks(rows: dict[str, ca.MX], along: list[str], ends: np.ndarray) -> _Blocks:
    """Return rows of a matrix cut into columns."""
    cut = {of: zip(along, ca.horzsplit(row, ends), strict=True) for of, row in rows.items()}
    return {(of, name): block for of, blocks in cut.items() for name, block in blocks}


def _bringing(function: ca.Function, *derivatives: ca.Function) -> ca.Function:
    """Return the same function of SX, with what CasADi asks for when it is differentiated."""
    cache = {derivative.name(): derivative for derivative in derivatives}
    # Directional derivatives, too, come from the Jacobian.
    return _again(function, {"cache": cache, "enable_forward": False})


def _again(function: ca.Function, options: dict) -> ca.Function:
    flags = {"is_diff_in": function.is_diff_in(), "is_diff_out": function.is_diff_out()}
    inputs, names = function.sx_in(), (function.name_in(), function.name_out())
    return ca.Function(function.name(), inputs, function.call(inputs), *names, {**flags, **options})


def _jacobian(function: ca.Function, blocks: _Blocks, s: dict[str, ca.MX]) -> ca.Function:
    """Return what CasADi expects as a Jacobian: a block for every output along every input.

    Its inputs are those of the function, and the values of the function, none of which is used.
    """
    names, of = function.name_in(), function.name_out()
    values = [ca.MX.sym(f"out_{row}", ca.Sparsity(*function.size_out(row))) for row in of]
    outputs = [
        _sparse(blocks.get((row, name)), function.jac_sparsity(i, j))
        for i, row in enumerate(of)
        for j, name in enumerate(names)
    ]
    flags = {
        "is_diff_in": [*function.is_diff_in(), *function.is_diff_out()],
        "is_diff_out": [a and b for a in function.is_diff_out() for b in function.is_diff_in()],
    }
    return ca.Function(
        f"jac_{function.name()}",
        [*(s[name] for name in names), *values],
        outputs,
        [*names, *(f"out_{row}" for row in of)],
        [f"jac_{row}_{name}" for row in of for name in names],
        flags,
    )


def _sparse(block: ca.MX | None, pattern: ca.Sparsity) -> ca.MX:
    return ca.MX(pattern.size1(), pattern.size2()) if block is None else ca.project(block, pattern)
