r"""The same problem with states, controls, cost and rows measured in sizes of their own.

.. math::

    x = S_x \tilde x, \qquad u = S_u \tilde u, \qquad J = s_J \tilde J, \qquad c = S_c \tilde c

Time, parameters and signals keep their units.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from ocp.problem.cache import once_per_problem
from ocp.problem.constraint import PLACES, Box, Constraint
from ocp.problem.constraint_rows import ConstraintRow, ConstraintRows, ProblemRows, RowSizes
from ocp.problem.model import Model
from ocp.problem.nominal_sizes import Sizes, nominal_sizes
from ocp.problem.ocp import OCP
from ocp.problem.peak import Peak
from ocp.problem.rate import Rate

InSizes = Callable[[ca.SX | float, np.ndarray | float], ca.SX]

# A problem whose sizes lie within these is left as it is.
_WELL_SCALED, _WELL_SCALED_COST = (1e-3, 1e3), (1e-4, 1e4)
# Sizes are rounded to powers of this: to multiply by them loses no digit.
_BASE = 2.0


@once_per_problem
def sizes_of(ocp: OCP) -> Sizes:
    """Return the nominal sizes of a problem."""
    return nominal_sizes(ocp.explicit)


@once_per_problem
def scaled(ocp: OCP) -> "ScaledOCP | None":
    """Return the problem in sizes of its own; None where it is well scaled as it is."""
    if isinstance(ocp, ScaledOCP):  # or what a method made of one
        return None
    sizes = sizes_of(ocp)
    near = [*sizes.x, *sizes.u, *(size for rows in sizes.rows.values() for size in rows)]
    if _within(near, _WELL_SCALED) and _within([sizes.cost], _WELL_SCALED_COST):
        return None
    rounded = Sizes(
        _rounded(sizes.x),
        _rounded(sizes.u),
        float(_rounded(np.array(sizes.cost))),
        {name: _rounded(rows) for name, rows in sizes.rows.items()},
    )
    m = ocp.model
    symbols = ca.vertcat(m.x, m.u, m.start)
    measured = ca.DM(np.concatenate([rounded.x, rounded.u, rounded.x])) * symbols

    def in_sizes(expression: ca.SX | float, size: np.ndarray | float) -> ca.SX:
        return ca.substitute(ca.SX(expression), symbols, measured) / ca.DM(size)

    model = Model(
        name=m.name,
        x=m.x,
        u=m.u,
        f=in_sizes(m.f, rounded.x),
        t=m.t,
        dt=m.dt,
        start=m.start,
    )
    return ScaledOCP(
        name=ocp.name,
        model=model,
        x0=ocp.start() / rounded.x,
        horizon=ocp.horizon,
        running_cost=in_sizes(ocp.running_cost, rounded.cost),
        terminal_cost=in_sizes(ocp.terminal_cost, rounded.cost),
        control_bounds=_box(ocp.control_bounds, rounded.u),
        state_bounds=_box(ocp.state_bounds, rounded.x),
        constraints=tuple(
            _constraint(c, in_sizes, rounded.rows[c.name], rounded.cost) for c in ocp.constraints
        ),
        free_start=ocp.free_start,
        start_bounds=_box(ocp.start_bounds, rounded.x),
        parameters=ocp.parameters,
        unknowns=ocp.unknowns,
        peaks=tuple(
            Peak(peak.name, in_sizes(peak.expression, 1.0), peak.weight / rounded.cost)
            for peak in ocp.peaks
        ),
        rates=_rates(ocp, rounded),
        last_input=_last_input(ocp, rounded.u),
        delays=tuple(delay.per(float(rounded.u[delay.index(m)])) for delay in ocp.delays),
        smoothness=ocp.smoothness,
        original=ocp,
        sizes=rounded,
    )


def row_sizes(ocp: OCP) -> RowSizes | None:
    """Return what the rows of a problem are measured in where it is scaled; None: 1."""
    in_sizes = scaled(ocp.explicit)
    if in_sizes is None:
        return None
    sizes, rows = in_sizes.sizes, ocp.rows
    return RowSizes(sizes.x, sizes.u, sizes.of_rows(rows.path), sizes.of_rows(rows.terminal))


@dataclass(frozen=True, eq=False, kw_only=True)
class ScaledOCP(OCP):
    """A problem in sizes of its own; its rows and messages speak in the units of the original.

    Attributes:
        original: the problem as it was written.
        sizes: what everything is measured in.
    """

    original: OCP
    sizes: Sizes

    @cached_property
    def rows(self) -> ProblemRows:
        """Bounds and constraints, with the units of the original."""
        rows, sizes = super().rows, self.sizes
        of_constraint = {
            place: np.concatenate(
                [[], *[sizes.rows.get(c.name, np.ones(c.size)) for c in self.at(place)]]
            )
            for place in PLACES
        }
        return replace(
            rows,
            states=_with_units(rows.states, sizes.x),
            controls=_with_units(rows.controls, sizes.u),
            path=_with_units(rows.path, of_constraint["path"]),
            start=_with_units(rows.start, sizes.x),
            initial=_with_units(rows.initial, of_constraint["initial"]),
            terminal=_with_units(rows.terminal, of_constraint["terminal"]),
            integral=_with_units(rows.integral, of_constraint["integral"]),
            rates=_with_units(rows.rates, sizes.u[self.control_rates.index]),
        )


def with_row_sizes(ocp: OCP, sizes: Mapping[str, np.ndarray]) -> OCP:
    """Return a problem with what the rows of constraints are measured in that a method gave it.

    Args:
        ocp: made of a problem by ``dataclasses.replace``; only one in sizes of its own is changed.
        sizes: of the rows of each new constraint, by name.
    """
    if not isinstance(ocp, ScaledOCP):
        return ocp
    return replace(ocp, sizes=replace(ocp.sizes, rows={**ocp.sizes.rows, **sizes}))


def _with_units(rows: ConstraintRows, sizes: np.ndarray) -> ConstraintRows:
    each: list[ConstraintRow] = [
        replace(row, unit=float(size)) for row, size in zip(rows.rows, sizes, strict=True)
    ]
    return ConstraintRows(tuple(each), rows.expression)


def _constraint(c: Constraint, in_sizes: InSizes, sizes: np.ndarray, cost: float) -> Constraint:
    return Constraint(
        c.name,
        in_sizes(c.expression, sizes),
        np.asarray(c.lower) / sizes,
        np.asarray(c.upper) / sizes,
        at=c.at,
        limits_input=c.limits_input,
        soft=None if c.soft is None else c.soft.per(sizes, cost),
        times=c.times,
    )


def _rates(ocp: OCP, sizes: Sizes) -> tuple[Rate, ...]:
    rates = ocp.control_rates
    if not len(rates):
        return ()
    u, box = sizes.u[rates.index], _box(rates.box, sizes.u[rates.index])
    weight = rates.weight * u**2 / sizes.cost
    return (Rate(ocp.model.u[rates.index.tolist()], box.lower, box.upper, weight),)


def _last_input(ocp: OCP, sizes: np.ndarray) -> np.ndarray | None:
    last = ocp.last_input
    return None if last is None else np.asarray(last) / sizes[ocp.control_rates.index]


def _box(box: Box, sizes: np.ndarray) -> Box:
    return Box(np.asarray(box.lower) / sizes, np.asarray(box.upper) / sizes)


def _within(sizes: list[float], limits: tuple[float, float]) -> bool:
    return all(limits[0] <= size <= limits[1] for size in sizes)


def _rounded(sizes: np.ndarray) -> np.ndarray:
    return _BASE ** np.round(np.log(sizes) / np.log(_BASE))
