"""The one problem library: benchmarks and tests take their problems from here."""

from benchmarks.cases.arm import arm_cases, arm_parts, arm_scenario, comparison_cases
from benchmarks.cases.case import (
    Case,
    Difficulty,
    Family,
    KnownOptimum,
    PhasesCase,
    Published,
    Reference,
)
from benchmarks.cases.clearance import (
    Kind,
    clearance_cases,
    required_clearance,
    required_names,
    soft_optimum,
)
from benchmarks.cases.library.every import LIBRARY, TEXTBOOK
from benchmarks.cases.library.phases import PHASES
from benchmarks.cases.links import link_cases


def all_cases() -> tuple[Case, ...]:
    """Return every case of every suite."""
    return (
        *LIBRARY,
        *arm_cases(),
        *comparison_cases(),
        *link_cases(),
        *clearance_cases(),
    )


__all__ = [
    "LIBRARY",
    "PHASES",
    "TEXTBOOK",
    "Case",
    "Difficulty",
    "Family",
    "Kind",
    "KnownOptimum",
    "PhasesCase",
    "Published",
    "Reference",
    "all_cases",
    "arm_cases",
    "arm_parts",
    "arm_scenario",
    "clearance_cases",
    "comparison_cases",
    "link_cases",
    "required_clearance",
    "required_names",
    "soft_optimum",
]
