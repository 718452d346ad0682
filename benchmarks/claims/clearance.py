"""What is claimed of hard clearances, checked against the rows of a run."""

from collections.abc import Sequence

from benchmarks.cases import arm_scenario, required_clearance
from benchmarks.claims.claim import Claim
from benchmarks.questions.clear_motions import clear_motions
from benchmarks.sweep.row import Row

# Clearance and path, both in metres.
KEPT = 1e-6
# Costs in the same basin, relative.
SAME_COST = 1e-3
# The share of the feasible cases that a method has to solve.
SHARE = 0.95
SUITE = "clearance"


def clearance_claims(rows: Sequence[Row]) -> tuple[Claim, ...]:
    """Return the claims on the suite ``clearance`` that these rows can decide."""
    here = [row for row in rows if row.suite == SUITE]
    if not here:
        return ()
    feasible = {row.case for row in here if kept(row)}
    claims = [_solved(here, name, feasible) for name in dict.fromkeys(row.solver for row in here)]
    rest = [row for row in here if row.case not in feasible]
    return (*claims, _agreement(here), _decided(rest), _infeasible(rest))


def kept(row: Row) -> bool:
    """Whether clearance and path hold between the nodes, and the method stands behind it."""
    drift = row.task_drift if row.task_drift is not None else float("inf")
    violation = row.violation if row.violation is not None else float("inf")
    return row.solved and max(violation, drift) <= KEPT


def _solved(rows: Sequence[Row], solver: str, feasible: set[str]) -> Claim:
    mine = [row for row in rows if row.solver == solver and row.case in feasible]
    good = sum(kept(row) for row in mine)
    return Claim(
        f"{solver}: clearance and path held to 1e-6 m between the nodes on 95 % of the feasible",
        good >= SHARE * len(mine),
        f"{good} of {len(mine)}",
    )


def _agreement(rows: Sequence[Row]) -> Claim:
    gaps = [abs(row.local_gap) for row in rows if kept(row) and row.local_gap is not None]
    return Claim(
        "augmented Lagrangian: within 1e-3 of direct shooting started from its answer, on all",
        max(gaps, default=0.0) <= SAME_COST,
        f"worst {max(gaps, default=0.0):.1e} over {len(gaps)}",
    )


def _decided(rest: Sequence[Row]) -> Claim:
    """Not by a solver: over all configurations."""
    scenarios = sorted({row.case.removesuffix("-beyond") for row in rest})
    sweeps = [clear_motions(arm_scenario(s), required_clearance(s, "beyond")) for s in scenarios]
    good = sum(sweep.is_infeasible for sweep in sweeps)
    return Claim(
        "of every case that no method solves a sweep over all configurations shows that no "
        "motion is clear",
        good == len(scenarios),
        f"{good} of {len(scenarios)}",
    )


def _infeasible(rest: Sequence[Row]) -> Claim:
    good = sum(row.status == "INFEASIBLE" for row in rest)
    cases = len({row.case for row in rest})
    return Claim(
        "every infeasible case is called infeasible by every method",
        good == len(rest),
        f"{good} of {len(rest)} rows, {cases} cases",
    )
