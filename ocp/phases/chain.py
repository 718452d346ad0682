"""Phases one after another, checked against each other."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ocp.checks.arguments import check_instance, check_positive
from ocp.checks.errors import ProblemError
from ocp.phases.link import Link, LinkRows, link_rows
from ocp.problem.constraint import Box
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Parameter, Unknown
from ocp.problem.portable import Portable
from ocp.problem.problem_checks import check_distinct

# Durations that differ by less, relative, are the same.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Chain(Portable):
    """What ``Phases`` says."""

    name: str
    phases: tuple[OCP, ...]
    links: tuple[Link, ...] = ()
    total: float | Box | None = None
    unknowns: tuple[Unknown, ...] = ()

    def __post_init__(self) -> None:
        """Check phases, links, times and unknown constants against each other."""
        check_instance(self.name, str, "the name of phases")
        for what, kind in (("phases", OCP), ("links", Link), ("unknowns", Unknown)):
            entries = getattr(self, what)
            check_instance(entries, (tuple, list), f"{self.name}: {what}")
            for entry in entries:
                check_instance(entry, kind, f"{self.name}: an entry of {what}")
            object.__setattr__(self, what, tuple(entries))
        self._check_phases()
        self._check_unknowns()
        self._check_total()
        assert self.couplings is not None  # derived here, so that a wrong link is seen at once

    # -- what it is ---------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the phases."""
        return tuple(phase.name for phase in self.phases)

    def __repr__(self) -> str:
        """Return one line: the phases by name."""
        return f"<Phases '{self.name}': {', '.join(self.names)}>"

    @cached_property
    def derived(self) -> dict[str, Any]:
        """What other files have made of it, kept as long as it exists."""
        return {}

    @cached_property
    def couplings(self) -> tuple[LinkRows, ...]:
        """Links that decide something, as rows; the last of a cycle leads to the first phase."""
        each, count = list(enumerate(self.phases)), len(self.phases)
        links = self.links or (Link(),) * (count - 1)
        shared = ca.vertcat(ca.SX(0, 1), *[entry.symbol for entry in self.unknowns])
        every = [
            link_rows(self.name, link, each[i], each[(i + 1) % count], shared)
            for i, link in enumerate(links)
        ]
        return tuple(rows for rows in every if rows.decided)

    @cached_property
    def start_is_linked(self) -> tuple[np.ndarray, ...]:
        """Which states of each phase start where a link says, bool (nx,)."""
        found = [np.zeros(phase.model.nx, dtype=bool) for phase in self.phases]
        for rows in self.couplings:
            found[rows.after][list(rows.decided)] = True
        return tuple(found)

    @property
    def total_box(self) -> Box | None:
        """Bounds of the sum of all durations [s]; None where nothing couples them."""
        if self.total is None or isinstance(self.total, Box):
            return self.total
        return Box([self.total], [self.total])

    def unknown_of(self, entry: object) -> Unknown | None:
        """Return the unknown constant of all phases that a parameter of one stands for."""
        if not isinstance(entry, Parameter):
            return None
        return next((u for u in self.unknowns if _same(u.symbol, entry.symbol)), None)

    def expressions(self) -> list[ca.SX]:
        """Return all expressions, of phases, links and unknown constants."""
        parts = (*self.phases, *self.links, *self.unknowns)
        return [e for part in parts for e in part.expressions()]

    # -- checks at construction -----------------------------------------------------

    def _check_phases(self) -> None:
        count = len(self.phases)
        if count < 2:
            raise ProblemError(
                f"{self.name}: {count} phase{'s' * (count != 1)}; two or more are needed, one by "
                "itself is an OCP"
            )
        check_distinct(self.name, "phase", self.names)
        for phase in self.phases:
            if phase.model.is_discrete:
                raise ProblemError(
                    f"{self.name}: phase '{phase.name}' is discrete in time; phases need a model "
                    "with rates dx/dt"
                )
        if self.links and len(self.links) not in (count - 1, count):
            raise ProblemError(
                f"{self.name}: {len(self.links)} links for {count} phases; give {count - 1}, one "
                f"from each phase to the next, or {count} with one from the last to the first"
            )

    def _check_unknowns(self) -> None:
        check_distinct(self.name, "unknown constant", [u.name for u in self.unknowns])
        owner: dict[int, str] = {}
        for phase in self.phases:
            for entry in phase.unknowns:
                for symbol in ca.vertsplit(entry.symbol):
                    other = owner.setdefault(symbol.element_hash(), phase.name)
                    if other != phase.name:
                        raise ProblemError(
                            f"{self.name}: '{entry.name}' is an unknown constant of '{other}' and "
                            f"of '{phase.name}'; what phases share is a Parameter of each and an "
                            f"unknown of {self.name}: Phases(..., unknowns=(...,))"
                        )
        declared = [entry for phase in self.phases for entry in phase.parameters]
        in_links = ca.veccat(*[e for link in self.links for e in link.expressions()])
        for unknown in self.unknowns:
            if any(self.unknown_of(entry) is unknown for entry in declared):
                continue
            if not ca.depends_on(in_links, unknown.symbol):
                raise ProblemError(
                    f"{self.name}: unknown constant '{unknown.name}' ({unknown.symbol}) is in no "
                    "phase: declare its symbol as a Parameter of the phases that contain it"
                )

    def _check_total(self) -> None:
        if self.total is None:
            return
        what = f"{self.name}: total"
        if isinstance(self.total, Box):
            object.__setattr__(self, "total", self.total.sized(1, what))
        else:
            check_positive(self.total, what)
        box = self.total_box
        assert box is not None
        lower, upper = (float(np.ravel(side)[0]) for side in (box.lower, box.upper))
        shortest, longest = (self._durations(side) for side in ("lower", "upper"))
        if sum(shortest) > upper * (1.0 + _ROUNDING):
            raise ProblemError(
                f"{what} = {upper:g} s is below the sum of the shortest durations: "
                f"{self._in_words(shortest)}"
            )
        if sum(longest) < lower * (1.0 - _ROUNDING):
            raise ProblemError(
                f"{what} = {lower:g} s is above the sum of the longest durations: "
                f"{self._in_words(longest)}; give a phase a FreeTime, or a larger one"
            )

    def _durations(self, side: str) -> list[float]:
        return [float(np.ravel(getattr(phase.time_box, side))[0]) for phase in self.phases]

    def _in_words(self, durations: Sequence[float]) -> str:
        each = zip(self.names, durations, strict=True)
        return " + ".join(f"{name} {duration:g} s" for name, duration in each)


def _same(one: ca.SX, other: ca.SX) -> bool:
    parts = (ca.vertsplit(one), ca.vertsplit(other))
    hashes = [[symbol.element_hash() for symbol in part] for part in parts]
    return hashes[0] == hashes[1]
