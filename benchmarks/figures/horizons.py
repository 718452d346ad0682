"""Fig. 2.5 and 2.6: what finite-horizon control and model predictive control compute."""

import numpy as np
from matplotlib.axes import Axes

from benchmarks.figures.drawing import COLOURS, FINITE, REFERENCE, Drawing, held, label, sheet
from benchmarks.mpc.mass_loop import DT, LOAD, STEPS, feed_forward, receding, reference
from ocp import Rollout

_HORIZON, _SHOWN = 10, (0, 8, 16, 24)


def finite() -> Drawing:
    """Draw one plan for the whole task and what comes of it, with and without a load."""
    runs = {"as planned": feed_forward(), "with an unknown load": feed_forward(LOAD)}
    picture, columns = sheet(10.0, 5.5), {}
    states, inputs = picture.subplots(2, 1, sharex=True)
    for colour, (name, rollout) in zip((FINITE, "tab:red"), runs.items(), strict=True):
        _draw(states, inputs, rollout, name, colour)
        columns |= _columns(rollout, name)
    _finish(states, inputs)
    worst = [np.abs(r.x[:, 0] - reference(STEPS)[: len(r.x), 0]).max() for r in runs.values()]
    return Drawing(
        picture,
        columns,
        f"Fig. 2.5: finite-horizon control computes all inputs at the beginning and feeds them "
        f"forward: it is off the reference by up to {worst[0]:.2f} m, and by {worst[1]:.2f} m "
        f"under a load of {LOAD:g} N that it never learns of. Chosen here: the mass of 2.92 "
        f"(unstable), {1e3 * DT:g} ms.",
    )


def receding_horizon() -> Drawing:
    """Draw some plans, and the loop that takes the first input of each."""
    rollout = receding(_HORIZON, LOAD)
    picture, columns = sheet(10.0, 5.5), _columns(rollout, "closed loop")
    states, inputs = picture.subplots(2, 1, sharex=True)
    _draw(states, inputs, rollout, "closed loop", FINITE)
    for k, colour in zip(_SHOWN, COLOURS, strict=True):
        plan = rollout.decisions[k].plan
        assert plan is not None
        states.plot(plan.t, plan.x[:, 0], ".--", color=colour, label=f"plan at k = {k}")
        held(inputs, plan.t, plan.u[:, 0], color=colour, ls="--")
        columns |= {
            f"t, plan at {k} [s]": plan.t,
            f"position, plan at {k} [m]": plan.x[:, 0],
            f"force, plan at {k} [N]": plan.u[:, 0],
        }
    _finish(states, inputs)
    worst = [np.abs(r.x[:, 0] - reference(STEPS)[: len(r.x), 0]).max()
             for r in (rollout, feed_forward(LOAD))]  # fmt: skip
    return Drawing(
        picture,
        columns,
        f"Fig. 2.6: model predictive control plans N = {_HORIZON} steps anew at every step and "
        f"applies the first input: under the load of {LOAD:g} N it is off by up to "
        f"{worst[0]:.2f} m, feed-forward by {worst[1]:.2f} m. The plans part from the loop "
        f"because each sees {_HORIZON} steps only. Chosen here: the mass of 2.92 "
        f"(unstable), {1e3 * DT:g} ms.",
    )


def _draw(states: Axes, inputs: Axes, rollout: Rollout, name: str, colour: str) -> None:
    states.plot(rollout.t, rollout.x[:, 0], color=colour, label=name, lw=2)
    held(inputs, rollout.t, rollout.inputs[:, 0], color=colour)


def _finish(states: Axes, inputs: Axes) -> None:
    t = DT * np.arange(STEPS + 1)
    states.plot(t, reference(STEPS)[:, 0], label="reference", **REFERENCE)
    label(states, "", "position [m]")
    label(inputs, "time [s]", "force [N]")
    states.legend(fontsize=8)


def _columns(rollout: Rollout, name: str) -> dict[str, np.ndarray]:
    return {
        "t [s]": rollout.t,
        f"position, {name} [m]": rollout.x[:, 0],
        f"force, {name} [N]": rollout.inputs[:, 0],
    }
