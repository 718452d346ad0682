"""Phases in mathematics, as text for a person."""

from collections.abc import Iterable
from textwrap import indent

import casadi as ca
import numpy as np

from ocp.checks.expressions import readable
from ocp.phases.chain import Chain
from ocp.problem.describe import between, unknown_in_words


def describe_phases(chain: Chain) -> str:
    """Return every phase as it describes itself, and what couples them."""
    return "\n".join(_lines(chain))


def _lines(chain: Chain) -> Iterable[str]:
    yield f"{chain.name}   ({len(chain.phases)} phases: {', '.join(chain.names)})"
    for phase in chain.phases:
        yield ""
        yield indent(phase.describe(), "  ")
    yield ""
    yield "  coupled by"
    for rows in chain.couplings:
        said = f"from {chain.names[rows.before]} to {chain.names[rows.after]}"
        for row in ca.vertsplit(rows.rows):
            yield f"    {_equation(row)}   ({said})"
    if (box := chain.total_box) is not None:
        lower, upper = (float(np.ravel(side)[0]) for side in (box.lower, box.upper))
        yield f"    {between(lower, 'total duration', upper)} s"
    for entry in chain.unknowns:
        yield f"    {unknown_in_words(entry)}"


def _equation(row: ca.SX) -> str:
    """Write a row that is zero as an equation."""
    if row.is_op(ca.OP_SUB):
        return f"{readable(row.dep(0))} = {readable(row.dep(1))}"
    return f"{readable(row)} = 0"
