"""All cases of the library, in the order of its page."""

from benchmarks.cases.case import Case
from benchmarks.cases.library.chapter_2 import CHAPTER_2
from benchmarks.cases.library.closed_forms import CLOSED_FORMS
from benchmarks.cases.library.cycles_and_budgets import CYCLES_AND_BUDGETS
from benchmarks.cases.library.economics import ECONOMICS
from benchmarks.cases.library.estimation import ESTIMATION
from benchmarks.cases.library.flight import FLIGHT
from benchmarks.cases.library.life import LIFE
from benchmarks.cases.library.min_max import MIN_MAX
from benchmarks.cases.library.processes import PROCESSES
from benchmarks.cases.library.robots import ROBOTS
from benchmarks.cases.library.smooth import SMOOTH_PROBLEMS
from benchmarks.cases.library.state_constraints import STATE_CONSTRAINTS
from benchmarks.cases.library.switching import SWITCHING
from benchmarks.cases.library.vehicles import VEHICLES

LIBRARY: tuple[Case, ...] = (
    *CLOSED_FORMS,
    *SMOOTH_PROBLEMS,
    *SWITCHING,
    *STATE_CONSTRAINTS,
    *MIN_MAX,
    *ECONOMICS,
    *LIFE,
    *PROCESSES,
    *ESTIMATION,
    *ROBOTS,
    *VEHICLES,
    *FLIGHT,
    *CYCLES_AND_BUDGETS,
    *CHAPTER_2,
)

_SIX = {
    "double-integrator-energy",
    "double-integrator-minimum-time",
    "bryson-denham",
    "van-der-pol",
    "rayleigh",
    "hypersensitive",
}
# The six that every solver is tested on.
TEXTBOOK: tuple[Case, ...] = tuple(case for case in LIBRARY if case.name in _SIX)
