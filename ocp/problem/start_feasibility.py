"""Does a given start meet the constraints by itself?"""

from collections.abc import Iterator
from operator import itemgetter

import numpy as np

from ocp.checks.arguments import check_instance
from ocp.problem.constraint import Box
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData

_VIOLATED = 1e-6


def start_violation(ocp: OCP, data: RunData) -> str:
    """Return what a given start violates most, in words; "" if nothing.

    No solver imposes it, since nothing can be done about it. Only what the start alone decides
    counts: state bounds, and path constraints without the control. Up to 1e-6 is none.
    """
    check_instance(ocp, OCP, "start_fault: the problem")
    if ocp.has_free_start:
        return ""
    excess, name = max(_excesses(ocp, data), key=itemgetter(0))
    if excess <= _VIOLATED:
        return ""
    return f"'{name}' is violated by {excess:.3g} at t = {data.t0:.4g} s, by the given start itself"


def _excesses(ocp: OCP, data: RunData) -> Iterator[tuple[float, str]]:
    bounds = ocp.state_bounds.excess(data.x0)
    for name, excess in zip(ocp.model.x_names, bounds, strict=True):
        yield float(excess), f"bound of {name}"
    path = ocp.at("path")
    if not path:
        return
    lower, upper = (np.concatenate([getattr(c, side) for c in path]) for side in ("lower", "upper"))
    u = ocp.control_bounds.clip(np.zeros(ocp.model.nu))
    value = ocp.functions.path(data.x0, u, data.t0, data.values.at(0.0)[0])
    excess = Box(lower, upper).excess(np.array(value).ravel())
    alone = np.where(ocp.functions.path_on_control, 0.0, excess)
    names = [c.name for c in path for _ in range(c.size)]
    yield from zip(map(float, alone), names, strict=True)
