"""Fig. 2.7: what GPC predicts, split into free and forced response."""

import numpy as np

from benchmarks.figures.drawing import COLOURS, FINITE, REFERENCE, Drawing, label, sheet
from benchmarks.figures.predictive import MODEL, WEIGHT, law, run

_NOW, _AHEAD, _BACK = 6, 12, 6


def responses() -> Drawing:
    """Draw past and predicted inputs and outputs one step after the reference stepped."""
    controller, loop = law(_AHEAD), run(_AHEAD, preview=False)
    past_y, past_u = loop.y[: _NOW + 1], np.concatenate([[0.0], loop.u[:_NOW]])
    move = controller.step(past_y, past_u, loop.reference[_NOW + 1])
    free = controller.prediction.free(past_y, past_u)
    forced = controller.prediction.forced @ move.increments
    u_free = np.full(_AHEAD, past_u[-1])
    u_forced = np.cumsum(move.increments)
    happened = MODEL.simulate(np.concatenate([loop.u[:_NOW], u_free + u_forced]))[_NOW + 1 :]
    t_u, t_y = np.arange(_NOW + _AHEAD), np.arange(_NOW + _AHEAD + 1)
    zeros_u, zeros_y = np.zeros(_NOW), np.zeros(_NOW + 1)
    signals = {
        "all": (np.append(loop.u[:_NOW], u_free + u_forced), np.append(past_y, free + forced)),
        "free": (np.append(loop.u[:_NOW], u_free), np.append(past_y, free)),
        "forced": (np.append(zeros_u, u_forced), np.append(zeros_y, forced)),
    }
    picture = sheet(11.0, 6.0)
    grid = picture.subplots(2, 3, sharex=True, sharey="row")
    columns = {"t [steps]": t_y}
    titles = ("all: what is planned", "free: the input is held", "forced: the increments alone")
    for i, (name, (u, y)) in enumerate(signals.items()):
        colour = ("black", COLOURS[1], FINITE)[i]
        grid[0, i].step(np.append(t_u, t_u[-1] + 1), np.append(u, u[-1]), where="post", c=colour)
        grid[1, i].plot(t_y, y, ".-", color=colour)
        for row in (0, 1):
            grid[row, i].axvline(_NOW, color="gray", lw=1.0)
        label(grid[0, i], "", "input u" if i == 0 else "", titles[i])
        label(grid[1, i], "time [steps]", "output y" if i == 0 else "")
        columns |= {f"u, {name} [-]": u, f"y, {name} [-]": y}
    grid[1, 0].set_xticks(t_y[::3])
    grid[1, 0].step(t_y, loop.reference[t_y], where="post", label="reference", **REFERENCE)
    grid[1, 0].legend(fontsize=8, loc="lower right")
    grid[0, 0].annotate("now", (_NOW, 0.02), xycoords=("data", "axes fraction"),
                        xytext=(4, 3), textcoords="offset points", fontsize=8)  # fmt: skip
    columns["reference [-]"] = loop.reference[t_y]
    sentence = (
        f"Fig. 2.7: holding the input leads the output to {free[-1]:.2f} (free); the planned "
        f"increments add {forced[-1]:+.2f} (forced); the sum {free[-1] + forced[-1]:.2f} is at the "
        f"reference {loop.reference[_NOW]:g} and is what the plant does, to "
        f"{np.abs(happened - free - forced).max():.0e}. Chosen here: {_NOW - 5} step after the "
        f"reference stepped, N = {_AHEAD}, lambda = {WEIGHT:g}, plant 2.79 to 2.81 without noise."
    )
    return Drawing(picture, columns, sentence)
