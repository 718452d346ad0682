"""What to spend, to take, to dig."""

import numpy as np

from benchmarks.cases.case import Published
from benchmarks.cases.library.entry import DIRECT, FREE_END, SMOOTH, closed, entry, root
from models.textbook import consumption, fishery, mine

_RATE = (100.0 - 2000.0 * (1.0 - np.exp(-0.5))) * 0.075 / (1.0 - np.exp(-0.75))

ECONOMICS = (
    entry(
        consumption,
        "consumption",
        closed(_RATE**2 * (1.0 - np.exp(-0.75)) / 0.075, "c - 100 = k exp(-t/40)"),
        SMOOTH,
        "easy",
        "[InfiniteOpt]",
        published=(Published(67025.62, "[InfiniteOpt], on 1000 points"),),
    ),
    entry(
        mine,
        "mine",
        closed(-10.0 / 3.0, "u = 2 x/(6 - t), by Bellman's equation"),
        FREE_END,
        "smooth",
        "[DT QP]",
        costate0=(-1.0 / 3.0,),
    ),
    entry(
        fishery,
        "fishery",
        root(-106.905997911524, "full until x = 49, singular, full from the best instant on"),
        DIRECT,
        "singular",
        "[GEKKO], [InfiniteOpt]",
        published=(Published(-106.9081, "[GEKKO]"), Published(-106.8087, "[InfiniteOpt]")),
    ),
)
