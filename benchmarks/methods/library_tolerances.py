"""The tolerance table of the library: what each method has to reach, by what makes a case hard."""

from benchmarks.cases import Difficulty

# Two numbers for each kind of method and difficulty: the largest distance of the referee's cost
# from the reference interval, relative, and the largest violation between the nodes.
Tolerance = tuple[float, float]

# Intervals of the coarse and of the fine grid; boundary layers of 1 in 40 need more.
INTERVALS: dict[Difficulty, tuple[int, int]] = {"long": (400, 1600)}
USUAL = (100, 400)

# Held controls: an error of the order h² of the cost, h at an active mixed constraint; the states
# carry the integrator's error to the end. The largest on smooth ground is that of the cart-pole,
# 1.7e-3 at 100 intervals and a sixteenth of it at 400.
DIRECT_COARSE: dict[Difficulty, Tolerance] = {
    "easy": (2e-3, 1e-6),
    "smooth": (1e-3, 1e-6),
    "long": (5e-3, 1e-4),
    "nonconvex": (2e-3, 1e-4),
    "bang-bang": (5e-4, 1e-4),
    "singular": (2e-5, 1e-6),
    "state-constrained": (1e-3, 1e-3),
    "mixed-constrained": (5e-3, 5e-2),
}
DIRECT_FINE: dict[Difficulty, Tolerance] = {
    "easy": (1e-4, 1e-7),
    "smooth": (1e-4, 1e-7),
    "long": (5e-4, 1e-6),
    "nonconvex": (2e-4, 1e-6),
    "bang-bang": (5e-5, 1e-6),
    "singular": (2e-6, 1e-7),
    "state-constrained": (1e-4, 1e-4),
    "mixed-constrained": (1e-3, 1e-2),
}
# Margins at the nodes cost what they take, of the order h².
BETWEEN: dict[Difficulty, Tolerance] = {
    "bang-bang": (5e-4, 1e-6),
    "singular": (2e-5, 1e-6),
    "state-constrained": (1e-3, 1e-6),
}
# 300 RK4 steps over the horizon, and steps doubled until the cost holds to 1e-10.
INDIRECT: dict[Difficulty, Tolerance] = {
    "easy": (1e-8, 1e-8),
    "smooth": (5e-6, 1e-5),
    "long": (2e-3, 1e-3),
    "nonconvex": (1e-6, 1e-5),
}
EXTREMAL: dict[Difficulty, Tolerance] = {
    "easy": (1e-8, 1e-8),
    "smooth": (1e-8, 1e-7),
    "long": (1e-8, 1e-8),
    "nonconvex": (1e-8, 1e-8),
}
GRADIENT: dict[Difficulty, Tolerance] = {
    "easy": (2e-3, 1e-12),
    "smooth": (1e-3, 1e-12),
    "singular": (2e-5, 1e-12),
}

# Radau points, the mesh refined until the dynamics hold to 1e-8; what switches or touches a bound
# within an interval costs it its order.
COLLOCATION: dict[Difficulty, Tolerance] = {
    "easy": (1e-9, 1e-8),
    "smooth": (1e-5, 1e-8),
    "long": (1e-9, 1e-8),
    "nonconvex": (1e-9, 1e-7),
    "bang-bang": (1e-5, 1e-8),
    "singular": (2e-6, 1e-5),
    "state-constrained": (5e-6, 2e-6),
    "mixed-constrained": (1e-6, 2e-3),
}

TOLERANCES: dict[str, dict[Difficulty, Tolerance]] = {
    "direct-coarse": DIRECT_COARSE,
    "direct-fine": DIRECT_FINE,
    "direct-fatrop": DIRECT_COARSE,
    "newton": DIRECT_COARSE,
    "collocation": COLLOCATION,
    "direct-between": BETWEEN,
    "indirect": INDIRECT,
    "extremal": EXTREMAL,
    "gradient": GRADIENT,
}
