"""Seeded random scenarios of arms with 3 to 12 links."""

from functools import partial

from benchmarks.cases.case import Case
from models import random_scenarios
from ocp import OCP

LINKS = range(3, 13)
PER_ARM = 4
SEED = 1


def _build(links: int, index: int) -> OCP:
    return random_scenarios(links, PER_ARM, seed=SEED)[index].ocp("sum")


def link_cases() -> tuple[Case, ...]:
    """Return ``PER_ARM`` cases for each number of links; none has a reference."""
    return tuple(
        Case(
            name=f"arm-{links:02d}-links-{index}",
            suite="links",
            build=partial(_build, links, index),
            source="seeded random scenario",
            reference=None,
            difficulty="nonconvex",
            families=frozenset({"direct", "gradient", "indirect", "polish"}),
        )
        for links in LINKS
        for index in range(PER_ARM)
    )
