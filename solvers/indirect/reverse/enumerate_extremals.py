"""Every extremal of a problem with one redundant degree of freedom that a scan can find."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ocp import OCP, RK4, Guess, ProblemError, Solution, Status, UnsupportedProblem, Work, evaluate
from ocp.internal import RunData, check_instance, check_positive, check_whole
from solvers.indirect.indirect_shooting import IndirectShooting, IndirectShootingProgram
from solvers.indirect.reverse.crossings import Condition, Crossings, is_transversal, meets_start
from solvers.indirect.reverse.invariant_manifold import (
    InvariantManifold,
    Manifold,
    redundant_by_one,
)
from solvers.indirect.reverse.reverse_flow import ReverseFlow, Starts
from solvers.indirect.reverse.scan import Scan, Scanner
from solvers.indirect.reverse.self_motion import seeds_around, self_motions
from solvers.indirect.reverse.start_conditions import refuse_what_reverse_cannot
from solvers.indirect.shooting_segments import ShootingSchedule
from solvers.indirect.step_halving import halved_until_still

# Of the scan: enough to find a root that Newton, with its own steps, then makes exact.
_STEPS = 90
_SEGMENTS, _FINE_STEPS, _NEWTON_STEPS = 15, 300, 12
# By how much half of Newton's steps may change the cost, as in ``polish``.
_ACCURACY = 1e-8
# Two extremals with all states this close are one.
_SAME = 1e-6
# A start this far from the manifold is not on it.
_ON = 1e-6
# The tangent at the start tells sides within this multiple of the spacing.
_RADIUS = 2.5


@dataclass(frozen=True, eq=False)
class Enumeration:
    """The extremals of a problem, as far as the scan saw them.

    Attributes:
        solutions: cheapest first; ``SOLVED`` where the second-order test passed, else
            ``STATIONARY`` with what it found as message.
        costs: the referee's, (number,).
        scans: one for each component of the self-motion at t1.
        unresolved: jumps between neighbouring starts that the points did not suffice for: an
            extremal may hide in each.
        lost: roots of the scan that Newton, with finer steps, did not confirm.
        iterations: of Newton, on all roots.
        work: of scan and Newton; each motion integrated back from a point is a roll-out.
    """

    solutions: tuple[Solution, ...]
    costs: np.ndarray
    scans: tuple[Scan, ...]
    unresolved: int
    lost: int
    iterations: int
    work: Work

    @property
    def minima(self) -> tuple[Solution, ...]:
        """The extremals that passed the second-order test."""
        return tuple(s for s in self.solutions if s.status is Status.SOLVED)


def enumerate_extremals(
    ocp: OCP,
    *,
    x0: ArrayLike | None = None,
    t0: float = 0.0,
    parameters: Mapping[str, ArrayLike] | None = None,
    spacing: float = 0.3,
    points: int = 4000,
    keep: int | None = None,
    solver: IndirectShooting | None = None,
) -> Enumeration:
    r"""Scan the self-motion of the end configuration for extremals, and make them exact.

    Every extremal of a problem without terminal constraints ends with
    :math:`\psi(t_1) = \varphi_x(x(t_1))`, and where the dynamics keep m1 = n - 1 equations it
    ends on a curve: it belongs to a one-parameter family. The family is integrated back from
    that curve, which is refined until neighbouring starts are near; where the condition at
    the start (thesis 3.55 for a given one, 3.52 for a free one) changes its sign, or turns
    back just before zero, the root is closed in on, and indirect multiple shooting makes it
    exact. It is no proof: between two points of the scan nothing is evaluated.
    See the page on extremals in the documentation.

    Args:
        ocp: the problem, redundant by one.
        x0: start (nx,); default: the problem's.
        t0: initial time [s].
        parameters: values that differ from the declared ones.
        spacing: wanted distance of neighbouring starts, in the unit of the states.
        points: most points on one curve; the cheap motions are refined first.
        keep: make only so many of the cheapest roots exact; None: all of them.
        solver: that makes the roots exact; default: 15 segments, 300 steps.

    Raises:
        UnsupportedProblem: if the redundancy is not one, or for path, state or terminal
            constraints, and a free final time.
        ProblemError: if the target is out of reach, or the start is not on the manifold.
    """
    check_instance(ocp, OCP, "enumerate_extremals: the problem")
    check_whole(points, "enumerate_extremals: points")
    if keep is not None:
        check_whole(keep, "enumerate_extremals: keep")
    check_positive(spacing, "enumerate_extremals: spacing")
    _refuse(ocp)
    kept = InvariantManifold.of(ocp)
    redundant_by_one(kept)
    data = RunData.of(ocp, x0, t0, parameters)
    schedule, reverse = ShootingSchedule.of(ocp, data, _STEPS), ReverseFlow.of(ocp, _STEPS, RK4())
    start, end = kept.at(t0, schedule.p_first), kept.at(t0 + schedule.duration, schedule.p_last)
    motions = _Motions(reverse, schedule)
    scanner = Scanner(
        integrate=motions.starts,
        astray=lambda x: np.abs(start.linearised(x)[0]).max(axis=1),
        spacing=spacing,
        most=points,
    )
    crossings = Crossings(scanner, _condition(ocp, start, data.x0, _RADIUS * spacing))
    scans = tuple(scanner.scan(curve) for curve in self_motions(end, seeds_around(end, data.x0)))
    roots = [crossings.on(scan) for scan in scans]
    costs = np.concatenate([root.costs for root in roots])
    ends = np.vstack([root.ends for root in roots])[np.argsort(costs, kind="stable")[:keep]]
    guesses = [_guess(motions, start, row, data.x0) for row in ends]
    solver = solver or IndirectShooting(_SEGMENTS, _FINE_STEPS, max_steps=_NEWTON_STEPS)
    found = list(_exact(solver.prepare(ocp), data, guesses))
    return _enumeration(found, scans, Work(rollouts=motions.number))


def _enumeration(found: list[Solution], scans: tuple[Scan, ...], scanning: Work) -> Enumeration:
    """Return the distinct extremals among those found, the cheapest first."""
    solutions = _distinct([solution for solution in found if solution.status.is_success])
    judged = np.array([evaluate(solution).cost for solution in solutions])
    order = np.argsort(judged, kind="stable")
    return Enumeration(
        solutions=tuple(solutions[i] for i in order),
        costs=judged[order],
        scans=scans,
        unresolved=sum(scan.unresolved for scan in scans),
        lost=sum(not solution.status.is_success for solution in found),
        iterations=sum(solution.iterations for solution in found),
        work=sum((solution.work for solution in found), scanning),
    )


def _refuse(ocp: OCP) -> None:
    refuse_what_reverse_cannot(ocp)
    for c in ocp.at("terminal"):
        raise UnsupportedProblem(
            f"{ocp.name}: the costate at t1 is known only without the terminal constraint "
            f"'{c.name}'"
        )


def _condition(ocp: OCP, start: Manifold, x0: np.ndarray, radius: float) -> Condition:
    if ocp.has_free_start:
        return is_transversal(start)
    away = float(np.abs(start.linearised(x0[None, :])[0]).max())
    if away > _ON:
        raise ProblemError(f"{ocp.name}: the start misses {start.name} by {away:.3g}")
    return meets_start(start, x0, radius)


@dataclass
class _Motions:
    """Integrates back from the end, and counts how often.

    Attributes:
        reverse: the flow.
        schedule: over which horizon.
        number: motions so far.
    """

    reverse: ReverseFlow
    schedule: ShootingSchedule
    number: int = 0

    def starts(self, ends: np.ndarray) -> Starts:
        """Return where the motions that end there start."""
        self.number += len(ends)
        return self.reverse.starts(ends, self.schedule)

    def nodes(self, end: np.ndarray) -> np.ndarray:
        """Return states and costates of one motion, from its start."""
        self.number += 1
        return self.reverse.path(end, self.schedule).nodes[::-1]


def _guess(motions: _Motions, start: Manifold, end: np.ndarray, x0: np.ndarray) -> Guess:
    """Return the motion that ends at ``end``, turned back so that it begins near x0."""
    z = motions.nodes(end)
    x, costate = np.split(z, 2, axis=1)
    return Guess(x=x - start.periods.turns(x[0] - x0), costate=costate)


def _exact(
    program: IndirectShootingProgram, data: RunData, guesses: list[Guess]
) -> Iterator[Solution]:
    """Yield Newton's solution from each guess, with the outcome of the second-order test."""
    for guess in guesses:
        solution = program.run(
            x0=data.x0, t0=data.t0, parameters=data.values.as_dict(), guess=guess
        )
        solution, fine = halved_until_still(solution, program, _ACCURACY)
        if solution.status.is_success:
            verdict = fine.second_order(solution)
            status = Status.SOLVED if verdict.passed else Status.STATIONARY
            solution = solution.with_(status=status, message=verdict.reason)
        yield solution


def _distinct(solutions: list[Solution]) -> list[Solution]:
    kept: list[Solution] = []
    for solution in solutions:
        if all(solution.states_apart(other) > _SAME for other in kept):
            kept.append(solution)
    return kept
