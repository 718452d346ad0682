"""``python -m benchmarks mpc``, ``faults`` and ``followed``."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import reduce
from multiprocessing import get_context
from operator import add
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from benchmarks.cases import arm_scenario
from benchmarks.mpc import cart_pole_loop as cart_pole
from benchmarks.mpc.dial import HORIZONS, crossings_table, sweep
from benchmarks.mpc.endings import ENDINGS, loop_with
from benchmarks.mpc.faults import SUBJECTS, FaultReport, campaign
from benchmarks.mpc.followed import FollowedLoop, random_loops
from benchmarks.mpc.late import DELAY, delayed_loops
from benchmarks.mpc.loop_row import LoopRow
from benchmarks.mpc.mass_loop import DT, receding
from benchmarks.mpc.tables import SETTLING, faults_table, loops_table, said

_SHORT = (0.02, 0.06, 0.1, 0.2, 0.3)  # [s]
_ENDED = ("arm-001", "arm-002", "arm-004")
_DELAYED, _MASS_HORIZONS = 0.35, (5, 10, 20, 40)
# A step of the arm costs several of the cart.
_SHARES = {"cart": 0.5, "arm": 0.2, "heating": 0.3}


def print_loops(
    console: Console,
    out: Path,
    scenarios: Sequence[str],
    controllers: Sequence[str],
    horizons: Sequence[float] = HORIZONS,
) -> int:
    """Run the arm's loops that are not in ``out`` yet and print the rows; return 0."""

    def say(note: str) -> None:
        console.print(note, markup=False, highlight=False, soft_wrap=True)

    rows = list(sweep(out, scenarios, controllers, horizons, say))
    console.print(loops_table(rows, "closed loops of the arm, dt = 20 ms, cost by the plant"))
    console.print(crossings_table(rows))
    return 0


def print_endings(
    console: Console, scenarios: Sequence[str] = (), horizons: Sequence[float] = ()
) -> None:
    """Run the arm with short horizons and each terminal cost."""
    rows = []
    for name in scenarios or _ENDED:
        for horizon in horizons or _SHORT:
            for kind in ENDINGS:
                rollout = loop_with(arm_scenario(name), horizon, kind)
                rows.append(LoopRow.of(name, "direct", horizon, rollout, ending=kind))
    console.print(loops_table(rows, "terminal costs"))


def print_delay(
    console: Console, scenarios: Sequence[str] = (), horizons: Sequence[float] = ()
) -> None:
    """Run the arm with a computing delay."""
    rows = [
        LoopRow.of(name, what, horizon, rollout)
        for name in scenarios or _ENDED[:1]
        for horizon in horizons or (_DELAYED,)
        for what, rollout in delayed_loops(name, horizon).items()
    ]
    console.print(loops_table(rows, f"a computing delay of {1e3 * DELAY:g} ms"))


def print_mass(
    console: Console, scenarios: Sequence[str] = (), horizons: Sequence[float] = ()
) -> None:
    """Run the mass of 2.92, which has no scenarios."""
    steps = [max(1, round(h / DT)) for h in horizons] or _MASS_HORIZONS
    mass = {n: receding(n, bounded=True) for n in steps}
    rows = [LoopRow.of("mass 2.92", "linear", DT * n, rollout) for n, rollout in mass.items()]
    console.print(loops_table(rows, "the mass of 2.92, |position| <= 2 m"))


def print_cart_pole(
    console: Console, scenarios: Sequence[str] = (), horizons: Sequence[float] = ()
) -> None:
    """Swing the cart-pole up, which has no scenarios but plants."""
    rows = []
    for setting in cart_pole.settings(horizons or cart_pole.HORIZONS):
        rollout = cart_pole.loop(setting)
        settled = cart_pole.up_since(rollout)
        rows.append(
            LoopRow.of(setting.plant, setting.solver, setting.horizon, rollout, settled=settled)
        )
    console.print(loops_table(rows, f"the cart-pole, {cart_pole.BOUNDS}", SETTLING))


# What ``mpc --short`` runs besides the dial: (console, scenarios, horizons), none: its own.
SHORT = {
    "endings": print_endings,
    "delay": print_delay,
    "mass": print_mass,
    "cart-pole": print_cart_pole,
}


def print_faults(console: Console, steps: int, seed: int, workers: int = 1) -> int:
    """Run the campaign in processes of this machine and print it; return 0 if it is clean."""
    shares = {name: max(1, round(_SHARES[name] * steps)) for name in SUBJECTS}
    clean = True
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        for name, share in shares.items():
            report = reduce(add, _pieces(console, name, share, seed, pool))
            console.print(faults_table(report))
            console.print(said(report))
            clean &= report.is_clean
    return int(not clean)


def print_followed(console: Console, problems: int, seed: int) -> int:
    """Run random loops and print those that do not follow; return 0 if there is none."""
    loops: list[FollowedLoop] = []
    with Progress(console=console, transient=True) as bar:
        for found in bar.track(random_loops(problems, seed=seed), total=problems):
            loops.append(found)
            if not found.is_good:
                bar.console.print(str(found), markup=False, highlight=False, soft_wrap=True)
    solved, steps = sum(f.solved for f in loops), sum(f.steps for f in loops)
    followed, outside = sum(f.followed for f in loops), sum(f.outside for f in loops)
    console.print(
        f"{problems} problems, {steps} steps, {solved} solved: {followed} of these followed, "
        f"{outside} inputs outside a row that limits them"
    )
    return int(not all(f.is_good for f in loops))


def _pieces(
    console: Console, name: str, steps: int, seed: int, pool: ProcessPoolExecutor
) -> Iterator[FaultReport]:
    """Yield the reports of a campaign's pieces, with a bar of how many steps are done."""
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task(f"{name}, {steps} steps", total=steps)
        for piece in campaign(name, steps, seed=seed, executor=pool):
            bar.advance(task, piece.steps)
            yield piece
