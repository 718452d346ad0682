"""A problem in mathematics, as text for a person."""

from collections.abc import Iterable

import casadi as ca
import numpy as np

from ocp.checks.expressions import element_names, readable
from ocp.problem.constraint import Box, Constraint, Soft
from ocp.problem.measurement import Measurement
from ocp.problem.parameters import Unknown
from ocp.problem.statement import Statement


def describe(ocp: Statement) -> str:
    """Return the problem as it would stand in a paper."""
    return "\n".join(["", *_lines(ocp)]).lstrip("\n")


def _lines(ocp: Statement) -> Iterable[str]:
    m = ocp.model
    discrete = m.is_discrete
    tf = "T" if ocp.has_free_time else f"{ocp.duration:g}"
    counted = [_count(m.nx, "state"), _count(m.nu, "control")]
    counted += [_count(m.nz, "algebraic variable")] * (m.nz > 0)
    yield f"{ocp.name}   ({m.name}: {', '.join(counted)})"
    yield ""
    stage = f"sum k=0..{ocp.steps - 1} of L" if ocp.steps is not None else f"int 0..{tf} L dt"
    peaks = "".join(f" + {_times(p.weight)}max {p.name}" for p in ocp.peaks)
    yield f"  minimise    phi(x({tf}), {tf}) + {stage}{peaks}"
    yield f"    L   = {readable(ca.SX(ocp.running_cost))}"
    yield f"    phi = {readable(ca.SX(ocp.terminal_cost))}"
    for each in ocp.data:
        yield f"    + least squares of '{each.name}': {_measured(each)}"
    for peak in ocp.peaks:
        rows = ", ".join(readable(row) for row in ca.vertsplit(peak.expression))
        yield f"    {peak.name} = {rows}"
    yield "  subject to"
    for name, row in zip(m.x_names, ca.vertsplit(m.f), strict=True):
        left = f"{name}[k+1]" if discrete else f"d({name})/dt"
        yield f"    {left} = {readable(row)}"
    for name, row in zip(m.z_names, ca.vertsplit(m.algebraic), strict=True):
        yield f"    0 = {readable(row)}   (algebraic, of {name} and others)"
    if ocp.has_free_time:
        box = ocp.time_box
        yield f"    {between(np.asarray(box.lower)[0], 'T', np.asarray(box.upper)[0])} s, free"
    yield f"    x(0) = {_vector(ocp.x0)}" + _freedom(ocp.start_is_free, m.x_names)
    yield from _bounds(ocp.start_bounds, tuple(f"{n}(0)" for n in m.x_names), m.x_units)
    yield from _bounds(ocp.state_bounds, m.x_names, m.x_units)
    yield from _bounds(ocp.control_bounds, m.u_names, m.u_units)
    for delay in ocp.delays:
        history = f"before the start {_vector(delay.history)}"
        yield f"    {delay.control} acts {_count(delay.steps, 'step')} later   ({history})"
    yield from _rates(ocp)
    for c in ocp.constraints:
        yield from _constraint(c, _place(c))
    for c in ocp.invariants:
        yield from _constraint(c, "kept by the dynamics")
    for entry in ocp.unknowns:
        yield f"    {unknown_in_words(entry)}"
    for entry in ocp.parameters:
        symbols, kind = ", ".join(element_names(entry.symbol)), type(entry).__name__.lower()
        yield f"    {entry.name} ({symbols}): {kind}, {_vector(entry.value)}"


def _rates(ocp: Statement) -> Iterable[str]:
    """Say how fast controls may change, at what price, and from where on."""
    m, rates = ocp.model, ocp.control_rates
    bounds = np.asarray(rates.box.lower), np.asarray(rates.box.upper)
    for i, (k, low, high, w) in enumerate(zip(rates.index, *bounds, rates.weight, strict=True)):
        name = m.u_names[k]
        change = f"{name}[k] - {name}[k-1]" if m.is_discrete else f"d({name})/dt"
        last = ocp.last_input
        said = [f"at {w:g} ({change})^2"] if w > 0.0 else []
        said += ["last input free" if last is None else f"last input {np.asarray(last)[i]:g}"]
        yield f"    {between(low, change, high)}   ({', '.join(said)})"


def _measured(data: Measurement) -> str:
    """Say what was measured, and when."""
    rows = ", ".join(readable(row) for row in ca.vertsplit(data.expression))
    times = np.asarray(data.times)
    return f"{rows} at {_count(len(times), 'instant')}, t = {times[0]:g} to {times[-1]:g}"


def unknown_in_words(entry: Unknown) -> str:
    """Say what is known of an unknown constant: its bounds and the guess."""
    names = element_names(entry.symbol)
    each = zip(names, np.asarray(entry.lower), np.asarray(entry.upper), strict=True)
    bounds = [
        between(low, name, high) for name, low, high in each if np.isfinite([low, high]).any()
    ]
    said = ", ".join(["unknown constant", *bounds, f"guess {_vector(entry.value)}"])
    return f"{entry.name} ({', '.join(names)}): {said}"


def _freedom(free: np.ndarray, names: tuple[str, ...]) -> str:
    """Say which states start where the optimiser chooses."""
    if not free.any():
        return ""
    chosen = [name for name, is_free in zip(names, free, strict=True) if is_free]
    return "   (guess)" if free.all() else f"   ({', '.join(chosen)}: guess)"


def _times(weight: float) -> str:
    return "" if weight == 1.0 else f"{weight:g} "


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def _bounds(box: Box, names: tuple[str, ...], units: tuple[str, ...]) -> Iterable[str]:
    lower, upper = np.asarray(box.lower), np.asarray(box.upper)
    for i, name in enumerate(names):
        if np.isfinite(lower[i]) or np.isfinite(upper[i]):
            yield f"    {between(lower[i], name, upper[i])}" + (f" {units[i]}" if units else "")


def _constraint(c: Constraint, where: str) -> Iterable[str]:
    lower, upper = np.asarray(c.lower), np.asarray(c.upper)
    for i, row in enumerate(ca.vertsplit(c.expression)):
        said = f"{c.name}, {where}" if c.soft is None else f"{c.name}, {where}, {_soft(c.soft, i)}"
        yield f"    {between(lower[i], readable(row), upper[i])}   ({said})"


def _place(c: Constraint) -> str:
    if c.at != "instants":
        return str(c.at)
    return f"at t = {', '.join(f'{t:g}' for t in c.instants)}"


def _soft(soft: Soft, row: int) -> str:
    linear, quadratic = (float(np.asarray(v)[row]) for v in (soft.linear, soft.quadratic))
    parts = [f"{linear:g} e"] * (linear > 0.0) + [f"{quadratic:g} e^2"] * (quadratic > 0.0)
    return "soft at " + " + ".join(parts)


def between(lower: float, middle: str, upper: float) -> str:
    """Say between which bounds something lies; one that is infinite is left out."""
    if lower == upper:
        return f"{middle} = {lower:g}"
    left = f"{lower:g} <= " if np.isfinite(lower) else ""
    right = f" <= {upper:g}" if np.isfinite(upper) else ""
    return f"{left}{middle}{right}"


def _vector(values: object) -> str:
    array = np.asarray(values, dtype=float)
    if array.size > 8:
        return f"samples of shape {array.shape}"
    return "(" + ", ".join(f"{v:g}" for v in array.ravel()) + ")"
