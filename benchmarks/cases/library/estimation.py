"""Constants that are estimated from measurements."""

from benchmarks.cases.case import Published
from benchmarks.cases.library.entry import DIRECT, DOLAN, certified, computed, entry
from models.textbook import alpha_pinene, gas_oil, hiv, marine_population, methanol

_GAUSS = "Gauss and Newton on scipy's integration of the variational equations"
_LINEAR = "Gauss and Newton on exponentials of the matrix of rates"

ESTIMATION = (
    entry(
        alpha_pinene,
        "alpha-pinene",
        computed(19.872166934, 1e-8, f"{_LINEAR}, and Radau collocation"),
        DIRECT,
        "smooth",
        DOLAN,
        published=(Published(19.872, DOLAN),),
    ),
    entry(
        gas_oil,
        "gas-oil",
        certified("gas-oil"),
        DIRECT,
        "smooth",
        DOLAN,
        published=(Published(5.2366e-3, DOLAN), Published(5.228971e-3, "[Becerra 2010]")),
    ),
    entry(
        methanol,
        "methanol",
        computed(9.02228985e-3, 1e-9, f"{_GAUSS}, and Radau collocation"),
        DIRECT,
        "smooth",
        DOLAN,
        published=(Published(9.022e-3, DOLAN),),
    ),
    entry(
        marine_population,
        "marine-population",
        computed(19.7465297161, 1e-8, f"{_LINEAR}, and Radau collocation"),
        DIRECT,
        "smooth",
        DOLAN,
        published=(Published(19.747, f"{DOLAN}, in thousands"),),
    ),
    entry(
        hiv,
        "hiv",
        computed(15.160090871, 2e-8, f"{_GAUSS}, and Radau collocation"),
        # No direct method: fatrop does not return, and IPOPT takes its time.
        ("collocation",),
        "long",
        "[GEKKO]",
        published=(Published(31.410909, "[GEKKO]: at its rates"),),
        local_costs=(15.37723,),
    ),
)
