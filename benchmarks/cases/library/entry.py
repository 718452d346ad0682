"""How a case of the library is written down."""

from collections.abc import Callable

from benchmarks.cases.case import Case, Difficulty, Family, Published, Reference
from benchmarks.cases.library.certificates import committed
from ocp import OCP

SUITE = "library"
# What suits a smooth problem: with given ends, and with free ones.
SMOOTH: tuple[Family, ...] = ("direct", "collocation", "indirect", "polish")
FREE_END: tuple[Family, ...] = (*SMOOTH, "gradient")
DIRECT: tuple[Family, ...] = ("direct", "collocation")
# Discrete time has nothing to collocate.
DISCRETE: tuple[Family, ...] = ("direct",)
# A state constraint: once at the nodes, once between them too.
BETWEEN: tuple[Family, ...] = (*DIRECT, "between")

BONNANS = "[Bonnans et al. 2017]"
DOLAN = "[Dolan, More & Munson 2004]"
RUTQUIST = "[Rutquist & Edvall 2010]"

# Closed forms are evaluated in double precision; roots of equations are printed with 12 digits.
_ROUNDING, _PRINTED = 1e-14, 1e-12


def entry(
    build: Callable[[], OCP],
    name: str,
    reference: Reference | None,
    families: tuple[Family, ...],
    difficulty: Difficulty,
    source: str,
    *,
    published: tuple[Published, ...] = (),
    costate0: tuple[float, ...] | None = None,
    local_costs: tuple[float, ...] = (),
) -> Case:
    """Return a case of the suite ``library``; see ``Case``."""
    return Case(
        name=name,
        suite=SUITE,
        build=build,
        source=source,
        reference=reference,
        difficulty=difficulty,
        families=frozenset(families),
        published=published,
        costate0=costate0,
        local_costs=local_costs,
    )


def closed(value: float, formula: str) -> Reference:
    """Return a reference that is a formula."""
    return Reference(float(value), _ROUNDING * abs(value), f"closed form: {formula}")


def root(value: float, equations: str) -> Reference:
    """Return a closed form up to the root of one or two equations."""
    return Reference(value, _PRINTED * max(1.0, abs(value)), f"closed form: {equations}")


def certified(name: str) -> Reference | None:
    """Return the reference that ``python -m benchmarks certify`` wrote for a case.

    None before it is written, and where the certificate does not hold: the case can be built,
    so that it can be certified. The tests ask for one that holds.
    """
    entry = committed().entries.get(name)
    if entry is None or not entry["holds"]:
        return None
    lower, upper = entry["interval"]
    methods = " and ".join(estimate["method"] for estimate in entry["estimates"])
    how = f"certified: {methods}, {entry['digits']:.1f} digits alike"
    return Reference((lower + upper) / 2.0, (upper - lower) / 2.0, how)


def computed(value: float, error: float, how: str) -> Reference:
    """Return a reference that methods agree on of which ``certify`` has only one.

    Args:
        value: the best estimate.
        error: absolute; the optimum lies within it as far as the methods that are named tell.
        how: which methods.
    """
    return Reference(value, error, f"computed: {how}")
