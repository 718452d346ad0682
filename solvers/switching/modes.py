"""Which values which controls may take, and all choices of them: the modes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, Constraint, ProblemError, UnsupportedProblem
from ocp.internal import check_instance

# More modes than this are no switches any more: each is a control of the relaxed problem.
_MOST = 64
# Of so many choices those that constraints allow are looked for.
_MOST_CHOICES = 100_000


@dataclass(frozen=True, eq=False)
class Modes:
    """The controls that take listed values, and every choice that is allowed.

    Attributes:
        index: which controls these are, ascending, (m,).
        values: what they are in each mode, (M, m).
        limits: the names of constraints on these controls alone, which every mode meets.
    """

    index: tuple[int, ...]
    values: np.ndarray
    limits: frozenset[str]

    @classmethod
    def of(cls, ocp: OCP, levels: Mapping[str, ArrayLike]) -> "Modes":
        """Read and check them.

        Raises:
            ProblemError: naming the control and what is wrong with its values.
            UnsupportedProblem: naming a term that holds between the values only.
        """
        check_instance(levels, Mapping, "levels")
        names = ocp.model.u_names
        if not levels:
            raise ProblemError(
                f"{ocp.name}: levels is empty: name a control and its values, such as "
                f"{{'{names[0] if names else 'valve'}': (0, 1)}}"
            )
        for name in levels:
            if name not in names:
                raise ProblemError(
                    f"{ocp.name}: levels of '{name}', which is no control; they are "
                    f"{', '.join(names) or 'none'}"
                )
        index = tuple(i for i, name in enumerate(names) if name in levels)
        each = [_checked(ocp, i, levels[names[i]]) for i in index]
        _refuse(ocp, index)
        return cls(index, *_allowed(ocp, index, _choices(ocp, each)))

    @property
    def count(self) -> int:
        """Number of modes M."""
        return len(self.values)


def _choices(ocp: OCP, each: Sequence[Sequence[float]]) -> np.ndarray:
    """Return all choices of one value of each control, (M, m)."""
    count = prod(len(values) for values in each)
    if count > _MOST_CHOICES:
        raise UnsupportedProblem(
            f"{ocp.name}: {count} choices of levels, before constraints leave some out; "
            f"{_MOST_CHOICES} are the most: list fewer values"
        )
    return np.array(list(product(*each)))


def _checked(ocp: OCP, i: int, values: ArrayLike) -> list[float]:
    """Return the values of one control, checked."""
    name, box = ocp.model.u_names[i], ocp.control_bounds
    try:
        known = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise ProblemError(f"{ocp.name}: levels of '{name}' are no numbers: {values!r}") from None
    if known.ndim != 1 or not np.isfinite(known).all():
        raise ProblemError(f"{ocp.name}: levels of '{name}' are no finite numbers (k,): {values!r}")
    if len(known) < 2 or len(np.unique(known)) < len(known):
        raise ProblemError(
            f"{ocp.name}: levels of '{name}' are {known.tolist()}: two different values are needed "
            "at least, each once; of a single one write the number in place of the control"
        )
    low, high = float(np.asarray(box.lower)[i]), float(np.asarray(box.upper)[i])
    outside = known[(known < low) | (known > high)]
    if len(outside):
        raise ProblemError(
            f"{ocp.name}: the level {outside[0]:g} of '{name}' is outside its bounds, "
            f"{low:g} to {high:g}"
        )
    return known.tolist()


def _refuse(ocp: OCP, index: Sequence[int]) -> None:
    """Refuse what has no meaning between two values, or none where a control jumps."""
    v, names = ocp.model.u[list(index)], [ocp.model.u_names[i] for i in index]
    for rate in ocp.rates:
        if ca.depends_on(rate.control, v):
            raise UnsupportedProblem(
                f"{ocp.name}: a Rate of {rate.control}, which jumps between its levels: leave it "
                "out; how often it may switch follows from the number of intervals"
            )
        if not ocp.model.is_discrete:
            raise UnsupportedProblem(
                f"{ocp.name}: switched, with a Rate of {rate.control} in continuous time: the "
                "control is then no constant in an interval; write it as a state whose rate is a "
                "bounded control"
            )
    for delay in ocp.delays:
        if ca.depends_on(delay.control, v):
            raise UnsupportedProblem(
                f"{ocp.name}: a Delay of {delay.control}, which has levels: write the delay as "
                "states of the model"
            )
    for what, parts in (("constraint", ocp.constraints), ("peak", ocp.peaks)):
        for part in parts:
            if not ca.depends_on(part.expression, v):
                continue
            mixed = not isinstance(part, Constraint) or not _of_levels_alone(ocp, part, v)
            if mixed and getattr(part, "at", "path") != "integral":
                raise UnsupportedProblem(
                    f"{ocp.name}: the {what} '{part.name}' contains {' or '.join(names)}, which "
                    "has levels, and is no hard constraint on the way of such controls alone: "
                    "between the levels it would say something different; write it for states, or "
                    "for controls that have none"
                )


def _of_levels_alone(ocp: OCP, c: Constraint, v: ca.SX) -> bool:
    """Whether a hard constraint on the way says which levels go together, and nothing else."""
    known = {e.element_hash() for e in ca.vertsplit(v)}
    alone = all(e.element_hash() in known for e in ca.symvar(c.expression))
    return c.at == "path" and c.soft is None and alone


def _allowed(
    ocp: OCP, index: tuple[int, ...], values: np.ndarray
) -> tuple[np.ndarray, frozenset[str]]:
    """Return the modes that constraints on the levels alone allow, and the names of these."""
    v, names = ocp.model.u[list(index)], set[str]()
    for c in ocp.constraints:
        if ca.depends_on(c.expression, v) and _of_levels_alone(ocp, c, v):
            function = ca.Function("limit", [v], [ca.densify(c.expression)])
            rows = np.array(function.map(len(values))(values.T)).T
            values = values[(c.box.excess(rows) <= 0.0).all(axis=1)]
            names.add(c.name)
            if len(values) < 2:
                raise ProblemError(
                    f"{ocp.name}: the constraint '{c.name}' leaves {len(values)} of the choices of "
                    "levels; two are needed at least"
                )
    if len(values) > _MOST:
        raise UnsupportedProblem(
            f"{ocp.name}: {len(values)} choices of levels, {_MOST} are the most: each is a control "
            "of the relaxed problem; list fewer values, or solve without levels and round by hand"
        )
    return values, frozenset(names)
