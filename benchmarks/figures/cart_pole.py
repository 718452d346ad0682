"""Figure ``cart-pole``: the swing-up in closed loop, with its bounds."""

import numpy as np
from matplotlib.axes import Axes

from benchmarks.figures.drawing import COLOURS, REFERENCE, Drawing, held, label, sheet
from benchmarks.mpc.cart_pole_loop import CUSHION, DT, FORCE, TRACK, Setting, loop, up_since
from models import CartPole
from ocp import Rollout

_SHOWN = {
    "horizon 0.5 s": Setting("nominal", "fatrop", 0.5),
    "horizon 1 s": Setting("nominal", "fatrop", 1.0),
    "horizon 1.5 s": Setting("nominal", "fatrop", 1.5),
    "horizon 1 s, pole 10 % heavier, 5 % longer, noise": Setting("10 % off, noise", "fatrop", 1.0),
}
_DRAWN = "horizon 1 s"
_POSTURES = 1.5  # [s]
_GREY = "#8a8a8a"


def swing_up() -> Drawing:
    """Draw position, angle and force over time, and the motion of the pole."""
    runs = {name: loop(setting).or_raise() for name, setting in _SHOWN.items()}
    picture, columns = sheet(13.0, 7.5), {}
    grid = picture.add_gridspec(3, 2, width_ratios=(3, 2))
    positions, angles, forces = (picture.add_subplot(grid[i, 0]) for i in range(3))
    for colour, (name, rollout) in zip(COLOURS, runs.items(), strict=True):
        positions.plot(rollout.t, rollout.x[:, 0], color=colour, label=name)
        angles.plot(rollout.t, rollout.x[:, 1], color=colour)
        held(forces, rollout.t, rollout.inputs[:, 0], color=colour)
        columns |= {
            "t [s]": rollout.t,
            f"position, {name} [m]": rollout.x[:, 0],
            f"angle, {name} [rad]": rollout.x[:, 1],
            f"force, {name} [N]": rollout.inputs[:, 0],
        }
    for axes, bound in ((positions, TRACK), (forces, FORCE)):
        axes.axhline(bound, **REFERENCE)
        axes.axhline(-bound, **REFERENCE)
    for side in (-1.0, 1.0):
        positions.axhspan(side * (TRACK - CUSHION), side * TRACK, color="tab:red", alpha=0.12)
    for axes, what in ((positions, "position [m]"), (angles, "angle [rad]"), (forces, "force [N]")):
        label(axes, "time [s]" if axes is forces else "", what)
    angles.set_yticks([0.0, np.pi], ["0", "π"])
    positions.legend(fontsize=8, loc="lower right")
    _motion(picture.add_subplot(grid[:, 1]), runs[_DRAWN])
    return Drawing(picture, columns, _sentence(runs))


def _motion(axes: Axes, rollout: Rollout) -> None:
    """Draw cart and pole at every interval of the first part, darker with time."""
    last = round(_POSTURES / DT)
    length = CartPole().length
    for k in range(last + 1):
        p, angle = rollout.x[k, :2]
        tip = p + length * np.sin(angle), -length * np.cos(angle)
        shade = 0.15 + 0.85 * k / last
        axes.plot([p, tip[0]], [0.0, tip[1]], color=COLOURS[1], alpha=shade, lw=1.5)
        axes.plot(*tip, "o", color=COLOURS[0], alpha=shade, ms=6)
        axes.plot(p, 0.0, "s", color=_GREY, alpha=shade, ms=7)
    for side in (-TRACK, TRACK):
        axes.axvline(side, **REFERENCE)
    axes.set_aspect("equal")
    label(axes, "[m]", "[m]", f"{_DRAWN}: the first {_POSTURES:g} s, darker with time")


def _sentence(runs: dict[str, Rollout]) -> str:
    said = []
    for name, rollout in runs.items():
        since = up_since(rollout)
        result = "never up" if since is None else f"up from {since:.2f} s on"
        reach = np.abs(rollout.x[:, 0]).max()
        said.append(f"{name}: {result}, |position| <= {reach:.2f} m, cost {rollout.cost:.2f}")
    return (
        f"Fig. cart-pole: from hanging to standing in closed loop. {'; '.join(said)}. Dashed: the "
        f"bounds on the track, {TRACK:g} m, and on the force, {FORCE:g} N; red: where the "
        f"controller pays. Chosen here: masses 1 and 0.3 kg, 0.5 m, interval {1e3 * DT:g} ms, "
        f"MultipleShooting with fatrop."
    )
