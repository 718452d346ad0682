"""Reactors, rods and pendulums, some with algebraic variables."""

from benchmarks.cases.case import Published
from benchmarks.cases.library.entry import DIRECT, FREE_END, certified, entry, root
from models.textbook import heated_rod, parallel_reactions, rod_pendulum

PROCESSES = (
    entry(
        parallel_reactions,
        "parallel-reactions",
        certified("parallel-reactions"),
        (*DIRECT, "gradient"),
        "smooth",
        "[Bachmann et al. 2012]",
        published=(
            Published(-0.57354505723, "[Bachmann et al. 2012]"),
            Published(-0.5708552, "[GEKKO], on its grid"),
        ),
    ),
    entry(
        rod_pendulum,
        "rod-pendulum",
        certified("rod-pendulum"),
        (*DIRECT, "polish"),
        "nonconvex",
        "[Betts 2010, example 10.103]",
        published=(Published(12.8738850, "[Betts 2010]"),),
    ),
    entry(
        heated_rod,
        "heated-rod",
        root(0.400781987813, "Riccati, by the exponential of the Hamiltonian matrix"),
        FREE_END,
        "easy",
        "made for closed forms",
    ),
)
