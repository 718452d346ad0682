"""What a problem says, as numbers: whether a file belongs to it."""

from collections.abc import Mapping

import numpy as np

from ocp.problem.constraint import PLACES, Box, Constraint
from ocp.problem.ocp import OCP

# So many points at which functions are looked at; functions that agree there are the same.
_POINTS = 3
# Another compiler or another order of the same sum changes the last digits.
_RELATIVE = 1e-9
_PREFIX = "probe/"


def fingerprint(ocp: OCP) -> dict[str, np.ndarray]:
    """Return the values of a problem's functions at fixed random points, and its bounds.

    Values, not expressions: they stay the same where a term is written in another way or another
    version of CasADi writes it down. The points have t in [0, 1] and standard normal x, u and
    parameters: what happens only elsewhere is not seen. Start, parameter values and guess are
    left out: they belong to a run.
    """
    m, n_p, functions = ocp.model, ocp.p.numel(), ocp.functions
    rng = np.random.default_rng(0)
    points = [
        (rng.normal(size=m.nx), rng.normal(size=m.nu), rng.uniform(), rng.normal(size=n_p))
        for _ in range(_POINTS)
    ]
    along = {
        "dynamics": functions.rate,
        "running cost": functions.running_cost,
        "path constraints": functions.path,
    }
    at_ends = {
        "terminal cost": functions.terminal_cost,
        "initial constraints": functions.initial,
        "terminal constraints": functions.terminal,
    }
    if ocp.at("integral"):
        along["integral constraints"] = functions.integrands
    if ocp.peaks:
        along["peaks"] = functions.peaks
    if ocp.at("instants"):
        at_ends["instants constraints"] = functions.instants
    values = {name: [f(*point) for point in points] for name, f in along.items()}
    values |= {name: [f(x, t, p) for x, _, t, p in points] for name, f in at_ends.items()}
    parts = {
        name: np.concatenate([np.array(v).ravel() for v in each]) for name, each in values.items()
    }
    parts |= {
        "control bounds": _stacked(ocp.control_bounds),
        "state bounds": _stacked(ocp.state_bounds),
        "horizon": np.concatenate([_stacked(ocp.time_box), [ocp.model.dt or 0.0]]),
    }
    if ocp.free_start or ocp.start_bounds.is_active:
        parts["free start"] = np.concatenate([ocp.start_is_free, _stacked(ocp.start_bounds)])
    for at in PLACES:
        bounds = [np.append(_stacked(c), c.instants) for c in ocp.at(at)]
        if (name := f"{at} constraints") in parts:
            parts[name] = np.concatenate([parts[name], *bounds])
    if ocp.data:
        here = [functions.measured(x, t, p) for x, _, t, p in points]
        numbers = [n for m in ocp.data for n in (m.times, m.values, m.sigma)]
        parts["data"] = np.concatenate([np.ravel(np.array(v)) for v in (*here, *numbers)])
    if ocp.unknowns:
        parts["unknown constants"] = np.concatenate([_stacked(e.box) for e in ocp.unknowns])
    if ocp.peaks:
        weights = [peak.weight for peak in ocp.peaks]
        parts["peaks"] = np.concatenate([parts["peaks"], weights])
    if ocp.delays:
        parts["delays"] = np.array([(d.index(m), d.steps) for d in ocp.delays])
    if len(rates := ocp.control_rates):
        is_given = [ocp.last_input is not None]
        parts["rates"] = np.concatenate([rates.index, _stacked(rates.box), rates.weight, is_given])
    return parts


def differing(kept: Mapping[str, np.ndarray], here: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """Return the parts in which two problems differ; NaN and infinity agree with themselves."""
    return tuple(
        name
        for name in {**here, **kept}
        if name not in kept
        or name not in here
        or kept[name].shape != here[name].shape
        or not _same(kept[name], here[name])
    )


def fingerprint_entries(ocp: OCP) -> dict[str, np.ndarray]:
    """Return the probe by the names under which an archive keeps it."""
    return {f"{_PREFIX}{part}": values for part, values in fingerprint(ocp).items()}


def differing_in(data: Mapping[str, np.ndarray], ocp: OCP) -> tuple[str, ...]:
    """Return the parts in which a problem differs from an archive's; none where it kept none."""
    kept = {k.removeprefix(_PREFIX): v for k, v in data.items() if k.startswith(_PREFIX)}
    return differing(kept, fingerprint(ocp)) if kept else ()


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two parts agree to rounding, which is relative to their largest entry."""
    size = np.abs(a[np.isfinite(a)]).max(initial=0.0)
    return np.allclose(a, b, _RELATIVE, _RELATIVE * size, equal_nan=True)


def _stacked(box: Box | Constraint) -> np.ndarray:
    return np.concatenate([np.ravel(box.lower), np.ravel(box.upper)])
