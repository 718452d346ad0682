"""Does a given start meet the constraints by itself?"""

import numpy as np

from ocp.checks.arguments import check_instance
from ocp.problem.constraint_rows import Violation
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData

# Smaller violations are ignored.
_TOLERANCE = 1e-6


def start_violation(ocp: OCP, data: RunData) -> str:
    """Return what a given start violates most, in words; "" if nothing.

    No solver imposes it, since a given start cannot be changed. Only what the start alone decides
    counts: state bounds, and path constraints without the control. Violations below 1e-6 are
    ignored.
    """
    check_instance(ocp, OCP, "start_violation: the problem")
    rows = ocp.rows
    has_rows = bool(ocp.decided_by_start.any())
    if not has_rows and rows.states.box.contains(data.x0):
        return ""
    if ocp.start_is_free.all():
        return ""
    t = np.array([data.t0])
    free = ocp.start_is_free[None, :]
    found = [rows.states.largest_violation(data.x0[None, :], t, exempt=free)]
    if has_rows:
        u = ocp.control_bounds.clip(np.zeros(ocp.model.nu))
        values = np.array(ocp.functions.path(data.x0, u, data.t0, data.values.at(0.0)[0])).T
        exempt = ~ocp.decided_by_start[None, :]
        found.append(rows.path.largest_violation(values, t, exempt=exempt))
    worst: Violation = max(found, key=lambda violation: violation.amount)
    return f"{worst}, by the given start itself" if worst.amount > _TOLERANCE else ""
