"""The 40 scenarios of the planar arm, with both distance costs."""

import json
from dataclasses import replace
from functools import cache, partial
from importlib.resources import files

from benchmarks.cases.case import Case, Family, Reference
from models import ArmScenario, Combine
from ocp import OCP

# Bad news for Newton: `closest` has kinks where the closest link changes.
_FAMILIES: dict[Combine, frozenset[Family]] = {
    "sum": frozenset({"direct", "gradient", "indirect", "polish"}),
    "closest": frozenset({"direct", "gradient"}),
}
_COMPARED = "compare-"
_HOW = "best of direct starts, polished, for sum also enumerated extremals; 7-8 digits"
_ACCURACY = 1e-7


@cache
def _data() -> dict[str, dict]:
    text = (files("benchmarks") / "data" / "arm.json").read_text(encoding="utf-8")
    return {entry["name"]: entry for entry in json.loads(text)}


@cache
def arm_scenario(name: str) -> ArmScenario:
    """Return one of the scenarios arm-001 to arm-040."""
    entry = _data()[name]
    return ArmScenario(
        name=name,
        theta0=tuple(entry["theta0"]),
        obstacle=tuple(entry["obstacle"]),
        radius=entry["d_b"],
        influence=entry["d_m"],
        gain=entry["gain"],
        velocity=tuple(entry["velocity"]),
        horizon=entry["horizon"],
        label="ordinary" if entry["feasible_clearance"] else "infeasible",
    )


def _case(name: str, combine: Combine) -> Case:
    best = _data()[name][combine]
    return Case(
        name=f"{name}-{combine}",
        suite="arm",
        build=partial(_build, name, combine),
        source="seeded scenario of the thesis' arm",
        reference=_reference(best["cost"]),
        difficulty="nonconvex",
        families=_FAMILIES[combine],
        costate0=tuple(best["costate0"]) if best["costate0"] else None,
        local_costs=tuple(best["local_costs"]),
    )


def _reference(cost: float | None) -> Reference | None:
    return None if cost is None else Reference(cost, _ACCURACY * abs(cost), _HOW)


def _build(name: str, combine: Combine) -> OCP:
    return arm_scenario(name).ocp(combine)


def arm_cases() -> tuple[Case, ...]:
    """Return all 80, ``sum`` first."""
    return tuple(_case(name, combine) for combine in _FAMILIES for name in _data())


def comparison_cases() -> tuple[Case, ...]:
    """Return the same 80 as a suite of their own, for the comparison of thesis 3.2.6.

    There every method runs on both costs: the thesis shoots on the closest link's cost too.
    """
    every: frozenset[Family] = frozenset({"direct", "gradient", "indirect", "instantaneous"})
    return tuple(
        replace(case, name=_COMPARED + case.name, suite="comparison", families=every)
        for case in arm_cases()
    )


def arm_parts(case: Case) -> tuple[ArmScenario, Combine]:
    """Return the scenario of one of these cases, and its distance cost."""
    name = case.name.removeprefix(_COMPARED)
    for combine in _FAMILIES:
        if name.endswith(f"-{combine}"):
            return arm_scenario(name.removesuffix(f"-{combine}")), combine
    raise KeyError(case.name)
