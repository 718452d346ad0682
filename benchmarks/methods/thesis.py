"""The methods that thesis 3.2.6 compares, on the cost and with the settings it has."""

from collections.abc import Callable

from benchmarks.cases import Case, Family, arm_parts
from benchmarks.methods.method import Method, Outcome, Settings, judged, problem
from benchmarks.methods.tuned_kinematics import tuned_kinematics
from ocp import OCP, Guess, Solver, solve
from solvers import FixedStep, IndirectShooting, Schuetz

# Two hundredths of a second per step, as the thesis simulates.
SHOOTING_STEPS = 150
# The thesis' first guess of psi(t0), in the sign of the minimum principle.
THESIS_GUESS = (0.0, 10.0, -10.0)
# (3.50) as it stands, with Algorithm 1.
SHOT = IndirectShooting(steps=SHOOTING_STEPS, jacobian="finite-difference", damped=False)
LARGE, SMALL = Schuetz(step=FixedStep(0.1)), Schuetz(step=FixedStep(0.01))


def _instantaneous(case: Case, settings: Settings) -> Outcome:
    """The tuned controller of thesis 3.1 on the velocity form; its work without the tuning."""
    tuned = tuned_kinematics(*arm_parts(case))
    return Outcome(tuned.solution, tuned.verdict)


def _raw(solver: Solver) -> Callable[[Case, Settings], Outcome]:
    """The solver from zero controls on the cost as the thesis has it; the optimum is the same."""

    def run(case: Case, settings: Settings) -> Outcome:
        scenario, combine = arm_parts(case)
        return judged(solve(scenario.ocp(combine, cost="raw"), solver))

    return run


def best_shot(ocp: OCP) -> Outcome:
    """Return single shooting from both first guesses: the cheaper of those that converge.

    Iterations, work and time are those of both.
    """
    program = SHOT.build(ocp)
    shots = [program.run(), program.run(guess=Guess(costate=THESIS_GUESS))]
    best = min(map(judged, shots), key=lambda o: (not o.solution.status.is_success, o.verdict.cost))
    both = best.solution.with_(
        iterations=sum(shot.iterations for shot in shots),
        work=shots[0].work + shots[1].work,
        solve_time=sum(shot.solve_time for shot in shots),
    )
    return Outcome(both, best.verdict)


def _shoot(case: Case, settings: Settings) -> Outcome:
    return best_shot(problem(case))


def thesis_methods() -> tuple[Method, ...]:
    """Return the methods of thesis 3.2.6 as it has them, in the order of its text."""

    def method(name: str, family: Family, run: Callable, solver: object, about: str) -> Method:
        return Method(name, family, frozenset({"comparison"}), run, repr(solver), about)

    thesis = "Algorithm 2, raw cost"
    return (
        method("instantaneous", "instantaneous", _instantaneous, "210 candidates", "tuned"),
        method("schuetz-0.1", "gradient", _raw(LARGE), LARGE, f"{thesis}, alpha = 0.1"),
        method("schuetz-0.01", "gradient", _raw(SMALL), SMALL, f"{thesis}, alpha = 0.01"),
        method("single-shooting", "indirect", _shoot, SHOT, "Algorithm 1, both guesses"),
    )
