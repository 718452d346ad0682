r"""All phases at once, on a common clock: one problem for any method.

With s from 0 to 1 in every phase, T_i the duration of phase i and t_i the time in it,

.. math::

    \frac{dx_i}{ds} = T_i f_i(x_i, u_i, t_i), \quad
    t_i = t_0 + \sum_{j < i} T_j + s T_i, \quad
    J = \sum_i \varphi_i(x_i(1)) + \int_0^1 \sum_i T_i L_i \, ds

Durations that are free are unknown constants. A link couples x_i(1) with x_{i+1}(0), which terms
at the end contain as ``Model.start``. H is the sum of T_i H_i: the costates are those of the
phases.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.normal_form.normal_form import NormalForm, normal_form
from ocp.phases.chain import Chain
from ocp.phases.link import LinkRows
from ocp.problem.constraint import Box, Constraint
from ocp.problem.model import Model
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Parameter, ParameterValues, Signal, Steps, Unknown
from ocp.problem.portable import Portable
from ocp.problem.scaled import sizes_of

#: The parameter that is the initial time of the first phase [s].
START_TIME = "start time"


@dataclass(frozen=True, eq=False)
class Lane(Portable):
    """One of the phases side by side.

    Attributes:
        phase: as it was written.
        form: its normal form, None where it is that already.
        x: where its states stand among all.
        u: where its controls stand.
        duration: symbol of its duration, or the number [s].
    """

    phase: OCP
    form: NormalForm | None
    x: slice
    u: slice
    duration: ca.SX

    @property
    def base(self) -> OCP:
        """The phase in normal form."""
        return self.phase if self.form is None else self.form.problem

    @property
    def has_free_time(self) -> bool:
        """Whether its duration is an unknown."""
        return self.phase.has_free_time

    def named(self, name: str) -> str:
        """Return what a term of the phase is called among those of all."""
        return f"{self.phase.name}: {name}"


@dataclass(frozen=True, eq=False)
class SideBySide(Portable):
    """Phases, and the one problem that is made of them.

    Attributes:
        chain: the phases.
        lanes: where each phase stands.
        problem: on [0, 1], with unknown constants and the state at the start in its terms.
    """

    chain: Chain
    lanes: tuple[Lane, ...]
    problem: OCP

    @classmethod
    def of(cls, chain: Chain) -> "SideBySide":
        """Put phases side by side."""
        lanes, nx, nu = [], 0, 0
        for phase in chain.phases:
            form = normal_form(phase)
            m = (phase if form is None else form.problem).model
            duration = ca.SX(phase.duration)
            if phase.has_free_time:
                duration = ca.SX.sym(f"{phase.name}: duration")
            lanes.append(Lane(phase, form, slice(nx, nx + m.nx), slice(nu, nu + m.nu), duration))
            nx, nu = nx + m.nx, nu + m.nu
        return cls(chain, tuple(lanes), _Combined(chain, tuple(lanes)).problem)

    @cached_property
    def link_functions(self) -> tuple[ca.Function, ...]:
        """Of every link, (x, s, p) of the one problem at its end -> rows (m,), slopes in the start.

        The slopes are those in what the link decides of the start of the next phase.
        """
        ocp, m, found = self.problem, self.problem.model, []
        constraints = {c.name: c for c in ocp.constraints}
        for rows in self.chain.couplings:
            g = constraints[_link_name(self.chain, rows)].expression
            first = self.lanes[rows.after].x.start
            decided = m.start[[first + k for k in rows.decided]]
            outputs = [g, ca.densify(ca.jacobian(g, decided))]
            found.append(ca.Function("link", [m.x, m.t, ocp.p], outputs))
        return tuple(found)

    @property
    def own_controls(self) -> tuple[str, ...]:
        """Names of the controls that phases were written with, and of their rates."""
        names = [(lane, name) for lane in self.lanes for name in lane.phase.model.u_names]
        return tuple(lane.named(f"{of}{name}") for lane, name in names for of in ("", "rate of "))

    def durations(self, unknowns: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the durations of all phases [s], for values of the unknown constants."""
        each = [
            unknowns[lane.named("duration")][0] if lane.has_free_time else lane.phase.duration
            for lane in self.lanes
        ]
        return np.array(each, dtype=float)

    def parameters(self, given: Mapping[str, ArrayLike] | None, t0: float) -> dict[str, ArrayLike]:
        """Return parameter values of the one problem: those given by name go to all phases."""
        values: dict[str, ArrayLike] = {START_TIME: t0}
        for lane in self.lanes:
            for entry in lane.phase.parameters:
                if given and entry.name in given and self.chain.unknown_of(entry) is None:
                    values[lane.named(entry.name)] = given[entry.name]
        return values

    def values(self, lane: Lane, whole: Mapping[str, np.ndarray]) -> ParameterValues:
        """Return the numbers of a phase, for those of the one problem and its unknowns."""
        given = {}
        for entry in lane.phase.parameters:
            unknown = self.chain.unknown_of(entry)
            given[entry.name] = whole[lane.named(entry.name) if unknown is None else unknown.name]
        return lane.phase.parameter_values(given)


def side_by_side(chain: Chain) -> SideBySide:
    """Return the phases side by side; it is the same object whenever it is asked for."""
    found = chain.derived.get(side_by_side.__name__)
    if found is None:
        found = chain.derived.setdefault(side_by_side.__name__, SideBySide.of(chain))
    return found


@dataclass(frozen=True, eq=False)
class _Fresh:
    """A phase in symbols of its own, since phases may be written in the same ones."""

    old: ca.SX
    new: ca.SX
    x: ca.SX
    u: ca.SX
    parameters: tuple[Parameter | Signal | Steps, ...]

    @classmethod
    def of(cls, chain: Chain, lane: Lane, clock: ca.SX) -> "_Fresh":
        base, m = lane.base, lane.base.model
        x, u = (
            ca.vertcat(ca.SX(0, 1), *[ca.SX.sym(lane.named(name)) for name in names])
            for names in (m.x_names, m.u_names)
        )
        symbols, parameters = [ca.SX(0, 1)], []
        for entry in base.parameters:
            if (unknown := chain.unknown_of(entry)) is not None:
                symbols.append(unknown.symbol)
                continue
            symbols.append(ca.SX.sym(lane.named(entry.name), entry.symbol.numel()))
            parameters.append(replace(entry, name=lane.named(entry.name), symbol=symbols[-1]))
        old, new = ca.vertcat(m.x, m.u, m.t, base.p), ca.vertcat(x, u, clock, *symbols)
        return cls(old, new, x, u, tuple(parameters))

    @property
    def pair(self) -> tuple[ca.SX, ca.SX]:
        return self.old, self.new

    def __call__(self, expression: ca.SX | float) -> ca.SX:
        return ca.substitute(ca.SX(expression), self.old, self.new)


class _Combined:
    """The one problem, part by part."""

    def __init__(self, chain: Chain, lanes: tuple[Lane, ...]) -> None:
        self.chain, self.lanes = chain, lanes
        self.share, self.start_time = ca.SX.sym("share"), ca.SX.sym(START_TIME)
        begun = [self.start_time]
        for lane in lanes:
            begun.append(begun[-1] + lane.duration)
        self.fresh = [
            _Fresh.of(chain, lane, start + self.share * lane.duration)
            for lane, start in zip(lanes, begun, strict=False)
        ]

    @cached_property
    def problem(self) -> OCP:
        lanes, first = self.lanes, Parameter(START_TIME, self.start_time, 0.0)
        each = list(zip(lanes, self.fresh, strict=True))
        return OCP(
            name=self.chain.name,
            model=self.model,
            x0=np.concatenate([lane.base.start() for lane in lanes]),
            horizon=1.0,
            running_cost=sum(lane.duration * new(lane.base.running_cost) for lane, new in each),
            terminal_cost=sum(new(lane.base.terminal_cost) for lane, new in each),
            control_bounds=_joined([lane.base.control_bounds for lane in lanes]),
            state_bounds=_joined([lane.base.state_bounds for lane in lanes]),
            start_bounds=_joined([lane.base.start_bounds for lane in lanes]),
            free_start=self._free_start(),
            constraints=(*self._constraints(), *self._links(), *self._total()),
            parameters=(first, *(entry for new in self.fresh for entry in new.parameters)),
            unknowns=(*self._durations(), *self.chain.unknowns),
            smoothness=min(lane.base.smoothness for lane in lanes),
        )

    @cached_property
    def model(self) -> Model:
        each = list(zip(self.lanes, self.fresh, strict=True))
        sizes = [sizes_of(lane.base) for lane in self.lanes]
        return Model(
            name=" | ".join(lane.base.model.name for lane in self.lanes),
            x=ca.vertcat(*[new.x for new in self.fresh]),
            u=ca.vertcat(*[new.u for new in self.fresh]),
            f=ca.vertcat(*[lane.duration * new(lane.base.model.f) for lane, new in each]),
            t=self.share,
            x_nominal=np.concatenate([size.x for size in sizes]),
            u_nominal=np.concatenate([size.u for size in sizes]),
        )

    def _free_start(self) -> tuple[str, ...]:
        found = []
        for lane, new, linked in zip(
            self.lanes, self.fresh, self.chain.start_is_linked, strict=True
        ):
            free = lane.base.start_is_free.copy()
            free[: len(linked)] |= linked
            found += [str(new.x[int(k)]) for k in np.flatnonzero(free)]
        return tuple(found)

    def _constraints(self) -> list[Constraint]:
        return [
            Constraint(
                lane.named(c.name),
                new(c.expression),
                c.lower,
                c.upper,
                at=c.at,
                nominal=sizes_of(lane.base).rows[c.name],
                limits_input=c.limits_input,
            )
            for lane, new in zip(self.lanes, self.fresh, strict=True)
            for c in lane.base.constraints
        ]

    def _links(self) -> list[Constraint]:
        found = []
        for rows in self.chain.couplings:
            after, new = self.lanes[rows.after], self.fresh[rows.before]
            m = after.phase.model
            first = after.x.start
            start = self.model.start[first : first + m.nx]
            # Before all others: phases may be written in the same symbols.
            pairs = [(m.start, start), new.pair, self.fresh[rows.after].pair]
            expression = _replaced(rows.rows, pairs)
            zero, name = np.zeros(expression.numel()), _link_name(self.chain, rows)
            found.append(Constraint(name, expression, zero, zero, at="terminal"))
        return found

    def _total(self) -> list[Constraint]:
        box, total = self.chain.total_box, sum((lane.duration for lane in self.lanes), ca.SX(0))
        if box is None or not any(lane.has_free_time for lane in self.lanes):
            return []
        return [Constraint("total duration", total, box.lower, box.upper, at="terminal")]

    def _durations(self) -> list[Unknown]:
        found = []
        for lane in self.lanes:
            if lane.has_free_time:
                box, guess = lane.phase.time_box, lane.phase.duration
                name = lane.named("duration")
                found.append(Unknown(name, lane.duration, guess, box.lower, box.upper))
        return found


def _link_name(chain: Chain, rows: LinkRows) -> str:
    return f"{chain.names[rows.before]} -> {chain.names[rows.after]}"


def _joined(boxes: list[Box]) -> Box:
    return Box(
        np.concatenate([np.ravel(box.lower) for box in boxes]),
        np.concatenate([np.ravel(box.upper) for box in boxes]),
    )


def _replaced(expression: ca.SX, pairs: Iterable[tuple[ca.SX, ca.SX]]) -> ca.SX:
    """Put new symbols in the place of old ones; the first pair that has a symbol decides."""
    found: dict[int, tuple[ca.SX, ca.SX]] = {}
    for old, new in pairs:
        for symbol, instead in zip(ca.vertsplit(old), ca.vertsplit(new), strict=True):
            found.setdefault(symbol.element_hash(), (symbol, instead))
    olds, news = zip(*found.values(), strict=True)
    return ca.substitute(expression, ca.vertcat(*olds), ca.vertcat(*news))
