"""The cart-pole in closed loop: from hanging to standing, with little force and a short track.

|force| <= 12 N and |position| <= 0.6 m: the force is at its bound from the first step, and the cart
has to turn before the end of the track. The plant has the hard track and judges by it. What
the controllers solve has a cushion of 0.1 m instead, for two reasons. Where a hard track binds
(at 0.5 m it does), an optimal cart runs along it, the smallest error of the integrator leads
beyond it, and then no plan is feasible. And solvers that take no state bounds can so solve the
same problem as the direct ones.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models import CartPole, cart_pole_upright
from ocp import MPC, OCP, Plant, Rollout, Solution, Solver, solve
from solvers import IndirectShooting, MultipleShooting, Schuetz, StagewiseNewton

DT, DURATION = 0.05, 4.0  # [s]
FORCE, TRACK, CUSHION = 12.0, 0.6, 0.1  # [N], [m], [m]
BOUNDS = f"|force| <= {FORCE:g} N, |position| <= {TRACK:g} m"
HANGING = np.zeros(4)
HORIZONS = (0.5, 0.75, 1.0, 1.5)  # [s]
# What counts as up [rad], and as back in the middle [m].
_UP, _MIDDLE = 0.1, 0.1
# Of position [m], angle [rad] and their rates.
_NOISE = (1e-3, 2e-3, 1e-2, 2e-2)

SOLVERS: dict[str, Callable[[int], Solver]] = {
    "ipopt": MultipleShooting,
    "fatrop": lambda n: MultipleShooting(n, backend="fatrop"),
    "newton": StagewiseNewton,
    "shooting": lambda n: IndirectShooting(steps=n, tolerance=1e-8),
    "shooting-5": lambda n: IndirectShooting(segments=5, steps=n, tolerance=1e-8),
    "schuetz-sound": lambda n: Schuetz.sound(intervals=n),
}
# By how much the pole is heavier, and half as much longer, than the model's; all but the first
# have noisy sensors, too.
PLANTS = {"nominal": 0.0, "10 % off, noise": 0.1, "20 % off, noise": 0.2}


@dataclass(frozen=True)
class Setting:
    """Which loop: a plant of ``PLANTS``, a solver of ``SOLVERS``, a horizon [s]."""

    plant: str
    solver: str
    horizon: float


# Where single shooting and steepest descent are shown, at one horizon: they take long.
_SHOWN = 0.75


def settings(horizons: Sequence[float] = HORIZONS) -> list[Setting]:
    """Return all loops of the suite; the slow solvers only where 0.75 s is among the horizons."""
    fast = ("ipopt", "fatrop", "newton", "shooting-5")
    chosen = [Setting("nominal", solver, h) for solver in fast for h in horizons]
    if _SHOWN in horizons:
        chosen += [Setting("nominal", solver, _SHOWN) for solver in ("shooting", "schuetz-sound")]
    off = [name for name in PLANTS if name != "nominal"]
    return chosen + [Setting(plant, "fatrop", h) for plant in off for h in horizons]


def problem(horizon: float) -> OCP:
    """Return the problem over one horizon [s]."""
    return cart_pole_upright(horizon=horizon, force=FORCE, track=TRACK, cushion=CUSHION)


def plant(name: str) -> Plant:
    """Return one of ``PLANTS``, with the hard track and without the price of the cushion."""
    off, usual = PLANTS[name], CartPole()
    system = CartPole(pole=usual.pole * (1.0 + off), length=usual.length * (1.0 + off / 2.0))
    truth = cart_pole_upright(system, force=FORCE, track=TRACK)
    return Plant(ocp=truth, measurement_noise=_NOISE if off else 0.0)


def loop(setting: Setting, *, seed: int = 1) -> Rollout:
    """Run one loop from hanging at rest.

    Indirect solvers and descent get their first guess from the direct solution, as on the arm.
    """
    ocp, intervals = problem(setting.horizon), max(1, round(setting.horizon / DT))
    direct = setting.solver in ("ipopt", "fatrop", "newton")
    mpc = MPC(
        ocp=ocp,
        solver=SOLVERS[setting.solver](intervals),
        dt=DT,
        guess=None if direct else _first(ocp, intervals),
        backup=_braked,
    )
    return mpc.run(plant(setting.plant), HANGING, DURATION, seed=seed)


def _first(ocp: OCP, intervals: int) -> Solution:
    return solve(ocp, MultipleShooting(intervals))


def _braked(x: np.ndarray, t: float) -> np.ndarray:
    """Bring the cart back to the middle, whatever the pole does [N]."""
    return np.array([-20.0 * x[0] - 10.0 * x[2]])


def up_since(rollout: Rollout) -> float | None:
    """Return from when on [s] the pole stands and the cart is in the middle; None: not at the end.

    Standing is an angle within 0.1 rad of π, the middle a position within 0.1 m of 0.
    """
    off = np.abs(rollout.x[:, :2] - [0.0, np.pi]) > [_MIDDLE, _UP]
    away = np.flatnonzero(off.any(axis=1))
    if not away.size:
        return 0.0
    last = int(away[-1])
    return float(rollout.t[last + 1]) if last + 1 < len(rollout.t) else None
