"""The 40 scenarios with a hard clearance instead of a soft one."""

import json
from functools import cache, lru_cache, partial
from importlib.resources import files
from typing import Literal

from benchmarks.cases.arm import arm_cases, arm_scenario
from benchmarks.cases.case import Case
from ocp import OCP, Guess, Solution, solve
from solvers import IndirectShooting

Kind = Literal["beyond", "radius"]


@cache
def _required() -> dict[str, float]:
    """Clearance of the soft optimum (reference, ``sum``) plus 0.05 m, rounded to 0.1 mm."""
    text = (files("benchmarks") / "data" / "clearance.json").read_text(encoding="utf-8")
    return json.loads(text)


def required_names() -> tuple[str, ...]:
    """Return the names of the scenarios."""
    return tuple(_required())


def required_clearance(name: str, kind: Kind) -> float:
    """Return the distance from the disc's centre that every link has to keep [m].

    Args:
        name: of the scenario.
        kind: ``"beyond"``: 0.05 m more than the soft optimum keeps, so that the constraint
            acts; ``"radius"``: d_b, the disc itself.
    """
    return _required()[name] if kind == "beyond" else arm_scenario(name).radius


@lru_cache(maxsize=4)
def soft_optimum(name: str) -> Solution:
    """Return the best known optimum of the soft problem, from the costate of its reference."""
    case = next(case for case in arm_cases() if case.name == f"{name}-sum")
    return solve(case.build(), IndirectShooting(), guess=Guess(costate=case.costate0))


def _build(name: str, kind: Kind) -> OCP:
    """With ``"radius"`` nothing but the constraint keeps the arm away: the cost is the effort."""
    weight = 1.0 if kind == "beyond" else 0.0
    clearance = required_clearance(name, kind)
    return arm_scenario(name).ocp("sum", weight=weight, clearance=clearance)


def clearance_cases() -> tuple[Case, ...]:
    """Return the suites ``clearance`` and ``clearance-radius``, 40 cases each."""
    suites: tuple[tuple[str, Kind], ...] = (("clearance", "beyond"), ("clearance-radius", "radius"))
    return tuple(
        Case(
            name=f"{name}-{kind}",
            suite=suite,
            build=partial(_build, name, kind),
            source="the arm's scenarios; costs are compared among the methods",
            reference=None,
            difficulty="state-constrained",
            families=frozenset({"clearance"}),
        )
        for suite, kind in suites
        for name in _required()
    )
