"""What a step of linear control costs over the horizon.

Times are processor times of this process, so that other programs of the machine do not count;
what matters are exponents and ratios of one run.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from models import lq_regulator, mass_spring_damper, sinusoid, tracking_ocp, unstable_plant
from ocp import OCP, Box, Program
from solvers import Batch, LinearMPC, Riccati

HORIZONS = (10, 25, 50, 100, 200, 400)
# Exponents are fitted from here on: below, what a step costs whatever its length still counts.
FITTED_FROM = 50
PEER_HORIZON = 20
DT, BOUND, FORCE = 0.05, 2.0, 40.0
STATE_WEIGHT, INPUT_WEIGHT, END_WEIGHT = 100.0, 0.5, 100.0
# A method that takes longer than this for one step is not measured at longer horizons [s].
_PATIENCE = 2.0


@dataclass(frozen=True)
class Growth:
    """Medians of one step of a method over the horizon.

    Attributes:
        method: what was measured.
        steps: horizons N.
        times: median of a step at each of them [s].
    """

    method: str
    steps: tuple[int, ...]
    times: tuple[float, ...]

    @property
    def exponent(self) -> float | None:
        """Slope of log time over log N at the longer horizons; None with fewer than two."""
        points = [(n, t) for n, t in zip(self.steps, self.times, strict=True) if n >= FITTED_FROM]
        if len(points) < 2:
            return None
        n, t = np.log(np.array(points)).T
        return float(np.polyfit(n, t, 1)[0])


def mass_tracking(steps: int) -> OCP:
    """Return the problem of (2.92) to (2.94) with weights that every peer can state: numbers."""
    return tracking_ocp(
        mass_spring_damper().sampled(DT),
        sinusoid(DT * np.arange(steps + 1)),
        Q=STATE_WEIGHT,
        R=INPUT_WEIGHT,
        P=END_WEIGHT,
        x0=np.zeros(2),
        horizon=steps,
        control_bounds=Box(-FORCE, FORCE),
        state_bounds=Box([-BOUND, -np.inf], [BOUND, np.inf]),
    )


@dataclass(frozen=True, eq=False)
class LinearCase:
    """What a controller sees at one step: time [s], state (2,), reference ahead (N + 1, 2)."""

    t: float
    x: np.ndarray
    ahead: np.ndarray


def situations(steps: int, count: int) -> list[LinearCase]:
    """Return the steps of a closed loop while the bound of the position is in its horizon."""
    plant, program = mass_spring_damper().sampled(DT), LinearMPC().build(mass_tracking(steps))
    reference = sinusoid(DT * np.arange(count + 40 + steps + 1))
    seen, x = [], np.zeros(2)
    for k in range(count + 40):
        now = LinearCase(k * DT, x, reference[k : k + steps + 1])
        plan = program.run(x0=x, t0=now.t, parameters={"reference": now.ahead}).or_raise()
        if plan.history["multipliers"].any():
            seen.append(now)
        x = plant.A @ x + plant.B @ plan.u[0]
    return seen[:count]


def median_time(step: Callable[[LinearCase], object], seen: Sequence[LinearCase]) -> float:
    """Return the median time of a step [s]; the first one, which may prepare, does not count."""
    step(seen[0])
    taken = []
    for now in seen:
        started = process_time()
        step(now)
        taken.append(process_time() - started)
    return float(np.median(taken))


def growth(horizons: Sequence[int] = HORIZONS, count: int = 20) -> list[Growth]:
    """Measure what one step costs over the horizon.

    Constrained, on the mass: both forms of ``LinearMPC``. Unconstrained, on the unstable plant
    with fixed references (2.1.4): ``Batch`` and ``Riccati``, whose matrices are prepared in
    ``build``, and the same with that preparation, which a plant that changes needs at each step.
    """
    found: dict[str, list[tuple[int, float]]] = {}
    for steps in horizons:
        seen, mass, free = situations(steps, count), mass_tracking(steps), unconstrained(steps)
        for method, step in _steps(mass, free).items():
            known = found.setdefault(method, [])
            if not known or known[-1][1] < _PATIENCE:
                known.append((steps, median_time(step, seen)))
    return [
        Growth(method, *(tuple(part) for part in zip(*points, strict=True)))
        for method, points in found.items()
    ]


def unconstrained(steps: int) -> OCP:
    """Return the regulator of the unstable plant (2.53) with the weights (2.55)."""
    return lq_regulator(unstable_plant(), Q=100.0, R=500.0, P=10.0, x0=np.ones(3), horizon=steps)


def _steps(mass: OCP, free: OCP) -> dict[str, Callable[[LinearCase], object]]:
    def on_mass(program: Program) -> Callable[[LinearCase], object]:
        return lambda s: program.run(x0=s.x, t0=s.t, parameters={"reference": s.ahead})

    batch, riccati = Batch().build(free), Riccati().build(free)
    return {
        "LinearMPC, sparse": on_mass(LinearMPC().build(mass)),
        "LinearMPC, condensed": on_mass(LinearMPC(form="condensed").build(mass)),
        "Riccati": lambda s: riccati.run(x0=np.append(s.x, 1.0)),
        "Riccati, gains anew": lambda s: Riccati().build(free).run(x0=np.append(s.x, 1.0)),
        "Batch": lambda s: batch.run(x0=np.append(s.x, 1.0)),
        "Batch, matrices anew": lambda s: Batch().build(free).run(x0=np.append(s.x, 1.0)),
    }


def feedback_law_time(steps: int, count: int = 1000) -> float:
    """Return the time of applying Riccati's first gain, u = -K x [s]: a step of DP (2.1.4)."""
    gain, x = Riccati().prepare(unconstrained(steps)).K[0], np.ones(3)
    started = process_time()
    for _ in range(count):
        _ = -gain @ x
    return (process_time() - started) / count
