"""Rows of stages whose controls are held in blocks.

Each interval keeps a control of its own. Inside a block it is the next state of the interval
before, so that stages stay stages for a backend that looks for them.
"""

import casadi as ca
import numpy as np

from ocp.problem.constraint_rows import ConstraintRow, depends_on
from ocp.problem.control_blocks import ControlBlocks
from ocp.problem.ocp import OCP


def rows_by_stage(
    gaps: ca.MX, u: ca.MX, inside: ca.MX, blocks: ControlBlocks | None
) -> list[ca.MX]:
    """Return the rows of the first stage, and of the others: gaps, controls held, path.

    Args:
        gaps: of the states, one column a stage (nz, N).
        u: controls (nu, N).
        inside: path constraints (m, N).
        blocks: of controls; None: none is held.
    """
    if blocks is None:
        rows = ca.vertcat(gaps, inside)
        return [rows[:, 0], ca.vec(rows[:, 1:])]
    own, ahead = u[blocks.held.tolist(), :], [*blocks.follows[1:], False]
    return [
        ca.vertcat(gaps[:, k], *([own[:, k + 1] - own[:, k]] if goes_on else []), inside[:, k])
        for k, goes_on in enumerate(ahead)
    ]


def held_rows(ocp: OCP, blocks: ControlBlocks | None) -> tuple[list[ConstraintRow], set[int]]:
    """Return what holds the controls of an interval, and the intervals at whose start it does."""
    if blocks is None:
        return [], set()
    names = [ocp.model.u_names[i] for i in blocks.held]
    held = [ConstraintRow(f"block of {name}", "time", 1, 0.0, 0.0) for name in names]
    return held, set(np.flatnonzero(blocks.follows).tolist())


def on_held_controls(ocp: OCP, blocks: ControlBlocks | None) -> np.ndarray:
    """Return which path rows say the same all over a block, bool (m,)."""
    if blocks is None:
        return np.zeros(len(ocp.rows.path), dtype=bool)
    free = [i for i in range(ocp.model.nu) if i not in blocks.held]
    others = [ocp.model.x, ocp.model.u[free], ocp.model.t, ocp.p]
    others = ca.vertcat(*map(ca.vec, others))
    return ~depends_on(ocp.rows.path.expression, others)
