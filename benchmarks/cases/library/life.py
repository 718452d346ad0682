"""Medicine, and prey."""

from benchmarks.cases.case import Published
from benchmarks.cases.library.entry import DIRECT, certified, computed, entry
from models.textbook import predator_and_prey, tuberculosis, tumour

LIFE = (
    entry(
        predator_and_prey,
        "predator-and-prey",
        certified("predator-and-prey"),
        DIRECT,
        "bang-bang",
        "[Sager 2005]",
        published=(Published(1.344093, "[Becerra 2010]"),),
    ),
    entry(
        tumour,
        "tumour",
        certified("tumour"),
        DIRECT,
        "bang-bang",
        "[Betts 2010, section 6.17]",
    ),
    entry(
        tuberculosis,
        "tuberculosis",
        computed(5152.073124, 5e-6, "indirect multiple shooting, and Radau and Gauss collocation"),
        DIRECT,
        "smooth",
        "[Betts 2010, section 6.16]",
    ),
)
