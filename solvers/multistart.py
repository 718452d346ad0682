"""Solving from many starts: the distinct local optima they lead to."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Generic, TypeVar, overload

import numpy as np

from ocp import (
    OCP,
    Guess,
    Interrupted,
    Phases,
    PhasesSolution,
    ProblemError,
    Progress,
    Solution,
    Solver,
    evaluate,
)
from ocp.internal import check_instance, check_not_negative, check_positive, check_whole, told
from solvers.direct.multiple_shooting import MultipleShooting
from solvers.indirect.indirect_shooting import IndirectShooting
from solvers.many.solve_many import solve_many

# Two answers whose true costs and states agree to this, relative, are the same optimum.
_SAME_COST = 1e-4
_SAME_STATES = 0.05


#: A solution, of a problem or of phases.
S = TypeVar("S", Solution, PhasesSolution)


@dataclass(frozen=True, eq=False)
class LocalOptimum(Generic[S]):
    """One of the optima found.

    Attributes:
        solution: the best answer that led to it.
        cost: the referee's.
        found: how many starts ended in it.
    """

    solution: S
    cost: float
    found: int


@overload
def multistart(
    ocp: OCP,
    solver: Solver,
    starts: int,
    seed: int,
    *,
    amplitude: float = 3.0,
    violation: float = 1e-4,
    guesses: Sequence[Any] = (),
    progress: Progress | None = None,
) -> tuple[LocalOptimum[Solution], ...]: ...


@overload
def multistart(
    ocp: Phases,
    solver: Solver,
    starts: int,
    seed: int,
    *,
    amplitude: float = 3.0,
    violation: float = 1e-4,
    guesses: Sequence[Any] = (),
    progress: Progress | None = None,
) -> tuple[LocalOptimum[PhasesSolution], ...]: ...


def multistart(
    ocp: OCP | Phases,
    solver: Solver,
    starts: int,
    seed: int,
    *,
    amplitude: float = 3.0,
    violation: float = 1e-4,
    guesses: Sequence[Any] = (),
    progress: Progress | None = None,
) -> tuple[LocalOptimum[Any], ...]:
    """Solve from several starts and return the distinct local optima, best first.

    The first start is the problem's own; the others are ``random_guesses``, of phases for each.
    Unknown constants that phases share are not drawn: they start from their declared values.

    Args:
        ocp: the problem, or ``Phases``; built once.
        solver: any solver that starts from controls: not indirect shooting.
        starts: how many, the problem's own included.
        seed: of the random controls; the same seed gives the same starts.
        amplitude: standard deviation of the controls, in their own units (where a control is
            bounded, at most half its range).
        violation: an answer that violates a constraint by more, by the referee's evaluation, does
            not count.
        guesses: tried after the problem's own start, besides the random ones, such as
            ``via_point_guesses``; of phases one tuple with a guess for each.
        progress: told after each start how many are done, and the best cost so far.

    Returns:
        optima with their true costs; empty if no start succeeded.

    Raises:
        ProblemError: if there is no start, or the solver does not start from controls.
        Interrupted: on Ctrl-C; its ``so_far`` are the optima that were found.
    """
    if not isinstance(ocp, Phases):
        check_instance(ocp, OCP, "multistart: ocp")
    check_instance(solver, Solver, "multistart: solver")
    check_whole(starts, "multistart: starts")
    check_whole(seed, "multistart: seed", least=0)
    check_positive(amplitude, "multistart: amplitude")
    check_not_negative(violation, "multistart: violation", finite=False)
    check_instance(guesses, (tuple, list), "multistart: guesses")
    if isinstance(solver, IndirectShooting):
        raise ProblemError("indirect shooting starts from costates: polish the optima instead")
    tried = (None, *guesses, *_guesses(ocp, starts - 1, seed, amplitude))
    report = told(progress, "multistart")
    found: list[LocalOptimum[Any]] = []
    try:
        report(0, len(tried), _best(found))
        for k, solution in enumerate(_answers(ocp, solver, tried, report), start=1):
            if solution.status.is_success:
                verdict = evaluate(solution)
                if verdict.violation <= violation:
                    found = _merged(found, LocalOptimum(solution, verdict.cost, 1))
            report(k, len(tried), _best(found))
    except KeyboardInterrupt:
        raise Interrupted("multistart", _in_order(found)) from None
    return _in_order(found)


def _answers(
    ocp: OCP | Phases, solver: Solver, tried: Sequence[Any], report: Progress
) -> Iterator[Any]:
    """Yield the answer of every start, in their order; the native backend solves them together."""
    is_native = isinstance(solver, MultipleShooting) and solver.backend == "native"
    if is_native and isinstance(ocp, OCP):
        yield from _together(ocp, solver, tried, report)
        return
    started = perf_counter()
    program = ocp.built_by(solver) if isinstance(ocp, Phases) else solver.build(ocp)
    build_time = perf_counter() - started
    for guess in tried:
        yield program.run(guess=guess).with_(build_time=build_time)


def _together(
    ocp: OCP, solver: Solver, tried: Sequence[Any], report: Progress
) -> Iterator[Solution]:
    """Solve from all starts at once, then yield the answers; after Ctrl-C those that there are."""

    def solving(done: int, total: int, said: str = "", /) -> None:
        report(0, total, f"{done} solved")

    interrupt: Interrupted | None = None
    try:
        answers = solve_many(ocp, solver, guesses=tuple(tried), progress=solving)
    except Interrupted as interrupted:
        answers, interrupt = interrupted.so_far, interrupted
    for i in np.flatnonzero(answers.done).tolist():
        yield answers.solution(i)
    if interrupt is not None:
        raise interrupt


def _in_order(found: list[LocalOptimum[Any]]) -> tuple[LocalOptimum[Any], ...]:
    """Return optima, the cheapest first."""
    return tuple(sorted(found, key=lambda optimum: optimum.cost))


def _best(found: list[LocalOptimum[Any]]) -> str:
    """Say how many optima there are, and the best cost."""
    if not found:
        return "no optimum yet"
    return f"{len(found)} optima, best cost {min(o.cost for o in found):.6g}"


def random_guesses(ocp: OCP, number: int, seed: int, amplitude: float = 3.0) -> list[Guess]:
    """Return smooth random controls: a constant and half a cosine wave for each control.

    Unknown constants are drawn as well.

    Args:
        ocp: the problem.
        number: how many.
        seed: the same seed gives the same guesses.
        amplitude: standard deviation of both parts, in the controls' own units (where a
            control is bounded, at most half its range).
    """
    check_instance(ocp, OCP, "random_guesses: the problem")
    check_whole(number, "random_guesses: number", least=0)
    check_whole(seed, "random_guesses: seed", least=0)
    check_positive(amplitude, "random_guesses: amplitude")
    rng = np.random.default_rng(seed)
    box, nu = ocp.control_bounds, ocp.model.nu
    with np.errstate(invalid="ignore"):
        half_range = (np.asarray(box.upper, float) - np.asarray(box.lower, float)) / 2.0
    scale = np.where(np.isfinite(half_range), np.minimum(half_range, amplitude), amplitude)
    waves = np.stack([np.ones(51), np.cos(np.pi * np.linspace(0.0, 1.0, 51))])
    shapes = rng.normal(size=(number, 2, nu)) * scale
    return [Guess(u=waves.T @ shape, unknowns=_random_unknowns(ocp, rng)) for shape in shapes]


def _guesses(ocp: OCP | Phases, number: int, seed: int, amplitude: float) -> Sequence[Any]:
    """Return random guesses, of phases one for each with a seed of its own."""
    if isinstance(ocp, OCP):
        return random_guesses(ocp, number, seed, amplitude)
    each = [random_guesses(p, number, seed + i, amplitude) for i, p in enumerate(ocp.phases)]
    return list(zip(*each, strict=True))


def _random_unknowns(ocp: OCP, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return values of the unknown constants: between two bounds, else around the guess."""
    found = {}
    for entry in ocp.unknowns:
        around, (lower, upper) = 1.0 + np.abs(entry.value), (entry.box.lower, entry.box.upper)
        low = np.where(np.isfinite(lower), lower, entry.value - around)
        high = np.where(np.isfinite(upper), upper, entry.value + around)
        found[entry.name] = rng.uniform(low, high)
    return found


def _is_same(one: LocalOptimum[Any], other: LocalOptimum[Any]) -> bool:
    """Whether cost and states agree: a mirror image has the same cost."""
    if abs(one.cost - other.cost) > _SAME_COST * (1.0 + abs(one.cost)):
        return False
    here, there = _all_states(one.solution), _all_states(other.solution)
    size = 1.0 + np.abs(here.x).max()
    return bool(here.states_apart(there) <= _SAME_STATES * size)


def _all_states(solution: Solution | PhasesSolution) -> Solution:
    return solution.whole if isinstance(solution, PhasesSolution) else solution


def _merged(found: list[LocalOptimum[Any]], new: LocalOptimum[Any]) -> list[LocalOptimum[Any]]:
    for i, old in enumerate(found):
        if _is_same(old, new):
            better = min(old, new, key=lambda optimum: optimum.cost)
            merged = LocalOptimum(better.solution, better.cost, old.found + 1)
            return [*found[:i], merged, *found[i + 1 :]]
    return [*found, new]
