"""Every library problem posed again in the terms of the normal form, and solved to the same answer.

The same transcription has to give the same number; names and shapes are those of the problem.
"""

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from benchmarks.cases.case import Case
from benchmarks.cases.library.every import LIBRARY
from ocp import (
    OCP,
    Box,
    Constraint,
    FreeTime,
    Guess,
    Model,
    Peak,
    Rate,
    Soft,
    Solution,
    Unknown,
    evaluate,
    solve,
)
from ocp.internal import normal_form
from solvers import Collocation, MultipleShooting

# Costs agree to this, relative to 1 + cost: interior points relax bounds by 1e-8.
ALIKE = 1e-6
INTERVALS = 40
# Costates agree to this, relative to 1 + the largest.
COSTATES_ALIKE = 1e-6
# These poses leave the program as it is, row by row; others add unknowns: an interior point then
# takes another way to bounds and inequalities that act, and stops elsewhere near them.
SAME_PROGRAM = ("free start", "coupled ends")
# Costs of problems whose optimum is so flat that a solver stops anywhere near it.
FLAT = {"fuller": 1e-4, "pendulum-minimum-time": 1e-3, "mountain-car": 1e-3, "hiv": 1e-4}
# Of a solver, by the name of the problem: at the usual one costs of the beam are 2e-6 apart.
TOLERANCE = {"beam": 1e-11}


def _solvers(ocp: OCP) -> tuple[MultipleShooting, Collocation]:
    """Return a direct method of each kind, with a node at every instant of data."""
    instants = len({float(time) for m in ocp.data for time in np.asarray(m.times)})
    shooting, mesh = max(INTERVALS, instants + 1), max(16, instants + 1)
    tolerance = TOLERANCE.get(ocp.name, 1e-9)
    return MultipleShooting(shooting, tolerance=tolerance), Collocation(mesh, tolerance=tolerance)


Pose = Callable[[OCP], OCP | None]


def with_free_start(ocp: OCP) -> OCP | None:
    """A given start as one that is free between equal bounds."""
    if ocp.has_free_start:
        return None
    x0 = ocp.start()
    return replace(ocp, free_start=ocp.model.x_names, start_bounds=Box(x0, x0))


def with_unknown_parameters(ocp: OCP) -> OCP | None:
    """Every parameter as an unknown constant between equal bounds."""
    constants = [e for e in ocp.parameters if e.symbol.numel() == np.size(e.value)]
    if not constants:
        return None
    kept = tuple(e for e in ocp.parameters if e not in constants)
    unknowns = tuple(Unknown(e.name, e.symbol, e.value, e.value, e.value) for e in constants)
    return replace(ocp, parameters=kept, unknowns=unknowns)


def with_unknown_time(ocp: OCP) -> OCP | None:
    """A free final time as an unknown constant, over a horizon of 1."""
    horizon, m = ocp.horizon, ocp.model
    if not isinstance(horizon, FreeTime):
        return None
    total = ca.SX.sym("total")

    def stretched(expression: ca.SX | float) -> ca.SX:
        return ca.substitute(ca.SX(expression), m.t, total * m.t)

    return replace(
        ocp,
        model=replace(m, f=total * stretched(m.f)),
        horizon=1.0,
        running_cost=total * stretched(ocp.running_cost),
        terminal_cost=stretched(ocp.terminal_cost),
        constraints=tuple(
            replace(c, expression=stretched(c.expression) * (total if c.at == "integral" else 1.0))
            for c in ocp.constraints
        ),
        unknowns=(Unknown("total", total, horizon.guess, horizon.lower, horizon.upper),),
    )


def with_coupled_ends(ocp: OCP) -> OCP | None:
    """What terminal constraints ask, relative to the start."""
    ends, m = ocp.at("terminal"), ocp.model
    if not ends or ocp.has_free_start:
        return None

    def relative(c: Constraint) -> Constraint:
        if c.at != "terminal":
            return c
        at_start = ca.substitute(c.expression, m.x, m.start)
        if not ca.depends_on(at_start, m.start) or ca.depends_on(at_start, m.t):
            return c
        value = np.array(ca.Function("c", [m.start, m.t, ocp.p], [at_start])(
            ocp.start(), ocp.duration, ocp.parameter_values().at(0.0)[0]
        )).ravel()  # fmt: skip
        if not np.isfinite(value).all():
            return c
        return replace(
            c, expression=c.expression - at_start, lower=c.lower - value, upper=c.upper - value
        )

    posed = replace(ocp, constraints=tuple(relative(c) for c in ocp.constraints))
    return posed if posed.refers_to_start else None


def with_an_idle_integral(ocp: OCP) -> OCP | None:
    """An integral that is bounded far away."""
    if ocp.model.is_discrete or not ocp.model.nu:
        return None
    square = ca.sumsqr(ocp.model.u)
    idle = Constraint("spent", square / (1 + square), upper=1e9, at="integral", nominal=1e3)
    return replace(ocp, constraints=(*ocp.constraints, idle))


def with_soft_ends(ocp: OCP) -> OCP | None:
    """Terminal constraints at a price above their multipliers."""
    ends = ocp.at("terminal")
    if not ends:
        return None
    plain = solve(ocp, MultipleShooting(INTERVALS))
    price = 3.0 * (1.0 + float(np.abs(plain.costate).max()))
    soft = tuple(replace(c, soft=Soft(price)) if c.at == "terminal" else c for c in ocp.constraints)
    return replace(ocp, constraints=soft)


def with_rates_as_roots(ocp: OCP) -> OCP | None:
    """The rates as algebraic variables: the first through an equation that has to be solved."""
    m = ocp.model
    if m.nz:
        return None
    z = ca.SX.sym("z", m.nx)
    g = z - m.f
    g[0] = z[0] ** 3 + z[0] - m.f[0] ** 3 - m.f[0]
    model = replace(m, z=z, algebraic=g, f=z, z_guess=0.9 * m.f + 0.1)
    return replace(ocp, model=model)


POSED: dict[str, Pose] = {
    "algebraic": with_rates_as_roots,
    "free start": with_free_start,
    "unknown parameters": with_unknown_parameters,
    "unknown time": with_unknown_time,
    "coupled ends": with_coupled_ends,
    "integral": with_an_idle_integral,
    "soft ends": with_soft_ends,
}


def _agree(plain: Solution, posed: Solution, within: float) -> None:
    size = 1.0 + abs(plain.cost)
    assert abs(posed.cost - plain.cost) <= within * size
    assert posed.x.shape == plain.x.shape
    assert posed.u.shape == plain.u.shape
    if any(c.soft or c.at == "integral" for c in posed.problem.constraints):
        # To miss an end by the error of the integrator has a price here, and the integral has an
        # error of its own.
        return
    assert posed.status.is_success, posed.message
    assert abs(evaluate(posed).cost - evaluate(plain).cost) <= 10 * within * size


def _costates_alike(one: Solution, other: Solution) -> bool:
    apart = np.abs(one.costate - other.costate).max(initial=0.0)
    return bool(apart <= COSTATES_ALIKE * (1.0 + np.abs(one.costate).max(initial=0.0)))


def _has_inequalities(ocp: OCP) -> bool:
    unequal = [np.not_equal(c.lower, c.upper).any() for c in ocp.constraints]
    return any(unequal) or ocp.control_bounds.is_active or ocp.state_bounds.is_active


def _guess(plain: Solution, posed: OCP) -> Guess:
    """The plain answer, so that of several optima it is the same one."""
    m, at = posed.model, np.linspace(0.0, 1.0, 101)
    known = {"total": plain.duration} if any(e.name == "total" for e in posed.unknowns) else {}
    return Guess(
        x=plain.sample("x", at, m.nx),
        u=plain.sample("u", at, m.nu),
        duration=plain.duration,
        unknowns=known,
    )


@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize("case", LIBRARY, ids=lambda case: case.name)
@pytest.mark.parametrize("how", POSED)
def test_posed_through_the_normal_form_it_has_the_same_answer(how: str, case: Case) -> None:
    pose = POSED[how]
    ocp = case.build()
    posed = pose(ocp)
    if posed is None:
        pytest.skip("it has no such term")
    if (how, case.name) == ("algebraic", "hiv"):
        pytest.skip("data that do not tell its rates apart: with roots IPOPT ends 1e-4 away")
    is_plain = normal_form(ocp) is None  # else it is rewritten anyway
    assert (normal_form(posed) is None) == (how == "free start" and is_plain)
    for solver in _solvers(ocp):
        if ocp.model.is_discrete and isinstance(solver, Collocation):
            continue
        plain = solve(ocp, solver)
        if plain.status.is_success:
            guess = _guess(plain, posed)
            found = solve(posed, solver, guess=guess)
            _agree(plain, found, FLAT.get(case.name, ALIKE))
            if how in SAME_PROGRAM or not _has_inequalities(ocp):
                # From the same guess, and where the problem itself has the same ones once more:
                # multipliers of a state constraint of second order (beam) are never settled.
                known = solve(ocp, solver, guess=replace(guess, unknowns={}))
                assert found.costate.shape == known.costate.shape
                assert _costates_alike(known, found) or not _costates_alike(known, plain)


# Of the rate, relative to the size that its control has in a horizon.
_WEIGHT = 1e-3


# What wanders for minutes where it starts without a guess of its own, or ends where steps of this
# length do not follow the thermal.
WITH_A_GUESS = {"interceptor", "shuttle-reentry", "hang-glider"}


def _in_rates(ocp: OCP) -> tuple[OCP, OCP] | None:
    """Return a problem whose controls have rates, and the same with the rates as its controls."""
    m, box = ocp.model, ocp.control_bounds
    if m.is_discrete or not m.nu or ocp.has_free_start or ocp.rates or m.nz:
        return None
    r, last = ca.SX.sym("r", m.nu), box.clip(np.zeros(m.nu))
    posed = replace(ocp, rates=(Rate(m.u, weight=_WEIGHT),), last_input=last, guess=None)
    larger = Model(name=m.name, x=ca.vertcat(m.x, m.u), u=r, f=ca.vertcat(m.f, r), t=m.t)
    by_hand = replace(
        ocp,
        model=larger,
        x0=np.append(ocp.start(), last),
        running_cost=ca.SX(ocp.running_cost) + _WEIGHT * ca.sumsqr(r),
        control_bounds=Box(),
        state_bounds=ocp.state_bounds & box,
        start_bounds=Box(),
        guess=None,
    )
    return posed, by_hand


@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize("case", LIBRARY, ids=lambda case: case.name)
def test_with_rates_it_is_the_problem_with_a_larger_state(case: Case) -> None:
    if case.name in WITH_A_GUESS:
        pytest.skip("without a guess it wanders for minutes, or ends where it cannot be")
    both = _in_rates(case.build())
    if both is None:
        pytest.skip("no control in continuous time, a free start, rates, or algebraic variables")
    posed, by_hand = both
    for solver in _solvers(posed):
        hand = solve(by_hand, solver)
        if hand.status.is_success:
            m = posed.model
            guess = Guess(
                x=hand.x[:, : m.nx], u=hand.x[:, m.nx :], duration=hand.duration
            ) if len(np.unique(np.diff(hand.t).round(9))) == 1 else None  # fmt: skip
            found = solve(posed, solver, guess=guess)
            assert found.cost == pytest.approx(hand.cost, rel=FLAT.get(case.name, ALIKE), abs=ALIKE)
            assert found.u.shape[1] == m.nu


@pytest.mark.slow
@pytest.mark.over_library
@pytest.mark.parametrize("case", LIBRARY, ids=lambda case: case.name)
def test_with_a_peak_it_is_the_problem_with_a_constant_above(case: Case) -> None:
    ocp, top = case.build(), ca.SX.sym("top")
    if not ocp.model.nu or ocp.unknowns:
        pytest.skip("it has no control, or constants already")
    size = 1.0 + float(np.abs(ocp.start()).max())
    rows = ocp.model.x / size
    posed = replace(ocp, peaks=(*ocp.peaks, Peak("reach", rows)))
    by_hand = replace(
        ocp,
        terminal_cost=ca.SX(ocp.terminal_cost) + top,
        unknowns=(Unknown("top", top, 1.0),),
        constraints=(*ocp.constraints, Constraint("below", rows - top, upper=0.0)),
    )
    solver = _solvers(ocp)[0]
    hand = solve(by_hand, solver)
    if hand.status.is_success:
        found = solve(posed, solver, guess=_guess(hand, posed))
        assert found.cost == pytest.approx(hand.cost, rel=FLAT.get(case.name, ALIKE), abs=ALIKE)
