"""The basins of single shooting: which psi(t0) lead Newton where, and in how many steps."""

from typing import NamedTuple

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap

from benchmarks.cases import arm_scenario
from benchmarks.figures.drawing import Drawing, label, sheet
from ocp import OCP, RK4, minimum_principle
from solvers import enumerate_extremals

_SCENARIO = "arm-001"
# Two hundredths of a second per step, as the thesis simulates; its Algorithm 1 for the Jacobian.
_STEPS, _DELTA = 75, 1e-6
_POINTS, _MOST_STEPS = 31, 20
# psi(t1) that counts as zero: what differences of 1e-6 can reach.
_TOLERANCE, _LOST = 1e-6, 1e8
# Costates at t0 this close, relative, belong to the same extremal.
_SAME = 1e-2
# The thesis' guess, in the sign of the minimum principle.
_GUESS = np.array([0.0, 10.0, -10.0])
_MARGIN = 0.6


class _Runs(NamedTuple):
    """How the runs ended: psi(t0) where they converged, and the steps they took (0: never)."""

    psi: np.ndarray
    steps: np.ndarray


def basins() -> Drawing:
    """Draw the plane through the optimal psi(t0), zero and the thesis' guess."""
    ocp = arm_scenario(_SCENARIO).ocp("sum")
    found = enumerate_extremals(ocp)
    known = np.array([solution.costate[0] for solution in found.solutions])
    across, up = _plane(known[0])
    corners = np.array([[known[0] @ e, _GUESS @ e] for e in (across, up)])
    spans = [_span(row) for row in corners]
    a, b = np.meshgrid(*[np.linspace(*span, _POINTS) for span in spans])
    first = a.ravel()[:, None] * across + b.ravel()[:, None] * up
    runs = _newton(_end_costates(ocp), first)
    distances = np.linalg.norm(runs.psi[:, None] - known, axis=2) / (
        1.0 + np.linalg.norm(known, axis=1)
    )
    kind = np.where(
        runs.steps == 0,
        -1,
        np.where(distances.min(axis=1) < _SAME, distances.argmin(axis=1), len(known)),
    )
    minimum = np.array([any(s is m for m in found.minima) for s in found.solutions] + [False])
    group = np.where(kind < 0, 0, np.where(kind == 0, 3, np.where(minimum[kind], 2, 1)))
    picture = sheet(13.0, 6.6)
    left, right = picture.subplots(1, 2)
    box = (*spans[0], *spans[1])
    names = ["none", "no minimum", "another minimum", "the optimum"]
    colours = ListedColormap(["0.85", "tab:red", "#9ac43f", "#16306e"])
    image = left.imshow(group.reshape(a.shape), origin="lower", extent=box, aspect="auto",
                        cmap=colours, norm=BoundaryNorm(np.arange(-0.5, 4.0), 4))  # fmt: skip
    bar = picture.colorbar(image, ax=left, ticks=range(4), location="bottom")
    bar.ax.set_xticklabels(names)
    steps = np.where(runs.steps > 0, runs.steps, np.nan).reshape(a.shape)
    image = right.imshow(steps, origin="lower", extent=box, aspect="auto", cmap="viridis_r")
    picture.colorbar(image, ax=right, location="bottom", label="Newton steps")
    for axes, title in ((left, "where Newton ends"), (right, "in how many steps")):
        _marks(axes, float(known[0] @ across), (float(_GUESS @ across), float(_GUESS @ up)))
        label(
            axes,
            "ψ(t_0) along the optimal one [rad/s]",
            "ψ(t_0) across, towards the guess [rad/s]",
            title,
        )
    shares = [np.mean(group == i) for i in range(4)]
    new = int((kind == len(known)).sum())
    sentence = (
        f"Fig. basin: of {group.size} first guesses on the plane through the optimal ψ(t_0), zero "
        f"and the thesis' guess, single shooting (3.50) takes {100 * shares[3]:.0f} % to the "
        f"optimum, {100 * shares[2]:.0f} % to another minimum, {100 * shares[1]:.0f} % to an "
        f"extremal that is none, and {100 * shares[0]:.0f} % nowhere within {_MOST_STEPS} steps; "
        f"{len(np.unique(kind[(kind >= 0) & (kind < len(known))]))} of the {len(known)} extremals "
        f"of the scan are met, and {new} converged elsewhere. The stripes run along the "
        f"row space of J, where ψ(t_0) does nothing and Newton needs one step. Chosen here: "
        f"{_SCENARIO}, p_0 summed, undamped Newton with Algorithm 1 (δ = {_DELTA:g}), {_STEPS} "
        "steps of RK4."
    )
    data = {"ψ along [rad/s]": a.ravel(), "ψ across [rad/s]": b.ravel()}
    data |= {
        "extremal, in the order of cost; -1: none [-]": kind,
        "Newton steps; 0: none [-]": runs.steps,
    }
    return Drawing(picture, data, sentence)


def _plane(optimum: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two orthonormal directions: along the optimal costate, and from it towards the guess."""
    across = optimum / np.linalg.norm(optimum)
    up = _GUESS - (_GUESS @ across) * across
    return across, up / np.linalg.norm(up)


def _span(values: np.ndarray) -> tuple[float, float]:
    low, high = min(values.min(), 0.0), max(values.max(), 0.0)
    return low - _MARGIN * (high - low), high + _MARGIN * (high - low)


def _marks(axes: Axes, optimum: float, guess: tuple[float, float]) -> None:
    for point, marker, name in (
        ((optimum, 0.0), "*", "the optimum"),
        ((0.0, 0.0), "o", "ψ = 0"),
        (guess, "s", "the thesis' guess"),
    ):
        axes.plot(*point, marker, color="white", mec="black", ms=11, label=name)
    axes.legend(fontsize=8, loc="lower right")


def _end_costates(ocp: OCP) -> ca.Function:
    """psi(t0) -> psi(t1), from the given start."""
    flow, nx = minimum_principle(ocp).flow, ocp.model.nx
    z, t = ca.SX.sym("z", 2 * nx), ca.SX.sym("t")
    h, p = ocp.duration / _STEPS, ocp.parameter_values().at(0.0)[0]
    after = RK4()(lambda y, s: h * flow(y, t + h * s, p), z, 0.0, 1.0)
    step = ca.Function("step", [z, t], ca.cse([after])).mapaccum(_STEPS)
    psi = ca.MX.sym("psi", nx)
    last = step(ca.vertcat(ocp.start(), psi), h * np.arange(_STEPS)[None, :])[nx:, -1]
    return ca.Function("h", [psi], [last])


def _newton(end: ca.Function, psi: np.ndarray) -> _Runs:
    """Newton-Raphson (3.50) from many guesses (K, n) at once, with Algorithm 1."""
    psi, n = psi.copy(), psi.shape[1]
    steps = np.zeros(len(psi), dtype=int)
    active = np.arange(len(psi))
    for step in range(1, _MOST_STEPS + 2):
        shifts = np.vstack([np.zeros(n), _DELTA * np.eye(n)])
        points = (psi[active, None, :] + shifts).reshape(-1, n)
        ends = np.array(end.map(len(points))(points.T)).T.reshape(len(active), n + 1, n)
        norms = np.abs(ends[:, 0]).max(axis=1)
        done = norms <= _TOLERANCE
        steps[active[done]] = np.maximum(step - 1, 1)
        jacobians = (ends[:, 1:] - ends[:, :1]).transpose(0, 2, 1) / _DELTA
        going = ~done & (norms < _LOST) & np.isfinite(jacobians).all(axis=(1, 2))
        going[going] = np.abs(np.linalg.det(jacobians[going])) > 0.0
        active, ends, jacobians = active[going], ends[going, 0], jacobians[going]
        if not active.size:
            break
        psi[active] -= np.linalg.solve(jacobians, ends[:, :, None])[:, :, 0]
    return _Runs(psi, steps)
