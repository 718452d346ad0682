"""How many of the scenarios are feasible with a hard clearance: a table."""

from rich.table import Table

from benchmarks.cases import Kind, arm_scenario, required_clearance, required_names
from benchmarks.questions.clear_motions import Sweep, clear_motions
from models import ArmScenario

_TITLES: dict[Kind, str] = {
    "beyond": "0.05 m more than the soft optimum keeps",
    "radius": "the disc itself",
}


def clear_table(kind: Kind) -> Table:
    """Return what the sweep over all configurations says of the 40 scenarios."""
    names = required_names()
    title = f"clear motions: {_TITLES[kind]}"
    table = Table("scenario", "clearance asked [m]", "the end effector keeps [m]", "verdict")
    infeasible = 0
    for name in names:
        scenario, asked = arm_scenario(name), required_clearance(name, kind)
        found = clear_motions(scenario, asked)
        infeasible += found.is_infeasible
        table.add_row(
            name, f"{asked:.4f}", f"{scenario.path_clearance:.4f}", _verdict(scenario, found)
        )
    table.title = f"{title}; certainly infeasible: {infeasible} of {len(names)}"
    return table


def _verdict(scenario: ArmScenario, found: Sweep) -> str:
    if not found.is_infeasible:
        return f"possible, to {found.resolution:.4f} m"
    if found.reach == 0.0:
        return "none: not even the start"
    return f"none beyond t = {found.reach * scenario.horizon:.3f} s"
