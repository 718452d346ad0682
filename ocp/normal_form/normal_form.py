"""The normal form of a problem: what methods get, and where in it the user's terms stand."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.normal_form.draft import Draft
from ocp.normal_form.integral_constraints import add_integrals
from ocp.normal_form.soft_constraints import soften
from ocp.normal_form.unknown_constants import add_start, add_unknowns
from ocp.problem.cache import once_per_problem
from ocp.problem.ocp import OCP
from ocp.problem.portable import Portable


@dataclass(frozen=True, eq=False)
class NormalForm(Portable):
    """A problem in simpler terms: more states and controls behind its own.

    Attributes:
        original: the problem as it was written.
        problem: the one that methods get.
        unknowns: where unknown constants stand among its states, by name.
        integrals: where integrals stand among its states, by name of the constraint.
        start: where what terms contain of the state at the start stands among its states.
        from_start: which states of the original these are copies of.
        slacks: what the controls behind the own ones stand for, in terms of these.
    """

    original: OCP
    problem: OCP
    unknowns: dict[str, slice]
    integrals: dict[str, slice]
    start: slice
    from_start: tuple[int, ...]
    slacks: ca.SX

    def copied(self, x: np.ndarray) -> np.ndarray:
        """Return what the copy of the start is for a state at the start (nx,)."""
        return x[list(self.from_start)]

    @cached_property
    def slack(self) -> ca.Function:
        """(x, u, t, p) -> the controls behind the own ones that fit, p that of the original."""
        m = self.original.model
        return ca.Function("slack", [m.x, m.u, m.t, self.original.p], [ca.densify(self.slacks)])


@once_per_problem
def normal_form(ocp: OCP) -> NormalForm | None:
    """Return the normal form of a problem; None where it is written in simple terms already."""
    is_soft = any(c.soft is not None for c in ocp.constraints)
    if not (ocp.unknowns or ocp.at("integral") or ocp.refers_to_start or is_soft):
        return None
    draft = Draft.of(ocp)
    slacks = soften(draft)
    integrals = add_integrals(draft)
    from_start = ocp.used_of_start
    start = add_start(draft, from_start)
    unknowns = add_unknowns(draft)
    return NormalForm(ocp, draft.problem(), unknowns, integrals, start, from_start, slacks)
