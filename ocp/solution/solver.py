"""The interface of every solver: build once, run often."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar, Protocol, overload

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_instance
from ocp.checks.interrupts import interruptible
from ocp.problem.constraint_rows import ImposedRows
from ocp.problem.ocp import OCP
from ocp.problem.portable import Portable
from ocp.solution.composite import CompositeProblem, S
from ocp.solution.solution import Solution


class InitialGuess(Protocol):
    """Where a solver may start: a ``Guess``, a ``Solution``, an earlier plan moved in time."""

    @property
    def duration(self) -> float | None:
        """Final time minus t0 [s], where it is free."""
        ...

    def sample(self, part: str, fractions: np.ndarray, width: int) -> np.ndarray | None:
        """Return x, u or costate at fractions of the horizon, (len(fractions), width), or None."""
        ...


class Program(ABC):
    """A problem prepared by a solver: all symbolic work is done."""

    @property
    def is_stateful(self) -> bool:
        """Whether an answer depends on the runs before it, other than by the guess."""
        return False

    @abstractmethod
    def run(
        self,
        *,
        x0: ArrayLike | None = None,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> Solution:
        """Solve for these data. Of several threads that ask, each waits for the one before.

        Args:
            x0: start (nx,), a guess of it where the start is free; default: the problem's.
            t0: initial time [s].
            parameters: values of parameters and samples of signals that differ from the
                declared ones, by name.
            guess: a ``Solution`` of any solver, or a ``Guess``; default: the problem's.

        Returns:
            a solution whose ``status`` says how it ended; failure is no exception.

        Raises:
            ProblemError: if the data do not fit the problem.
            KeyboardInterrupt: after Ctrl-C; the program can be run again.
        """


class FeedbackProgram(Program):
    """A program that also prepares an answer for a start that is expected, and corrects it at once.

    Its correction is one real-time iteration: the problem linearised, with a quadratic cost, at the
    answer that was prepared. It differs from the answer of ``run`` by second-order terms in the
    distance of the start from the expected one. Sources: [Diehl et al. 2005], [Zavala & Biegler
    2009].
    """

    @property
    @abstractmethod
    def no_feedback(self) -> str:
        """Why it cannot for this problem with these options; empty where it can."""

    @abstractmethod
    def prepare_feedback(
        self,
        *,
        x0: ArrayLike,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        guess: InitialGuess | None = None,
    ) -> bool:
        """Solve for the expected data, see ``run``, and keep what ``feedback`` needs.

        The next ``run`` forgets it. Return whether there is an answer.
        """

    @abstractmethod
    def feedback(
        self,
        *,
        x0: ArrayLike,
        t0: float = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
    ) -> Solution | None:
        """Correct the answer that was prepared for another start, once.

        Returns:
            a solution with the status ``ITERATION_LIMIT``, with cost and residual of the problem
            itself; None where nothing was prepared for this time and these parameters, the
            corrected problem has no solution, or it is no longer like the problem itself.
        """


def why_no_feedback(program: Program) -> str:
    """Return why a program prepares no feedback; empty where it does."""
    if isinstance(program, FeedbackProgram):
        return program.no_feedback
    return "this method has none; take MultipleShooting(backend='native')"


class Solver(Portable, ABC):
    """A method with its options: a frozen dataclass whose fields are typed.

    Attributes:
        takes_phases: whether it can solve ``Phases``: starts that are free and coupled with ends.
    """

    takes_phases: ClassVar[bool] = False

    @abstractmethod
    def build(self, ocp: OCP) -> Program:
        """Do all symbolic work for a problem.

        Raises:
            UnsupportedProblem: naming the term that this method cannot treat.
        """

    def prepare(self, ocp: OCP) -> Program:
        """Build it for a problem whose sizes are chosen already, as a method around this one does.

        Here the same as ``build``; see ``ScalingSolver``.
        """
        return self.build(ocp)

    def imposed(self, ocp: OCP) -> ImposedRows:
        """Return the rows that a successful answer of this solver meets; here all, at all nodes.

        A solver that makes rows soft, or imposes them elsewhere than at its nodes, says so, and
        whoever judges its plans asks for it here.
        """
        return ImposedRows(ocp.rows)

    def for_control_loop(self, *, compiled: bool, time_limit: float) -> "Solver":
        """Return the solver as ``MPC`` runs it; here as it is.

        A method that can run machine code or has a ``time_limit`` replaces these options, and one
        around another solver passes the call on.

        Args:
            compiled: whether to run machine code; where not, the option stays as it is.
            time_limit: of a run where the option is left open [s].
        """
        return self

    def least_violating(self, ocp: OCP) -> Program | None:
        """Build what finds the trajectory that violates the hard rows of a problem least.

        It meets those that limit the input; see ``elastic``. None where no row is hard, or this
        method knows no such trajectory, as here.
        """
        return None

    def unjudged(self) -> "Solver":
        """Return the solver for a method that compares its answers with the referee by itself.

        Here as it is; see ``MethodSolver``.
        """
        return self


@dataclass(frozen=True, eq=False)
class BuiltProgram(Program):
    """A program that its solver can build again.

    So copies and pickles are made, in another process too: of options and problem. What a program
    keeps from its runs, such as an answer to start the next one from, stays behind.

    Attributes:
        solver: the options.
        ocp: the problem.
    """

    solver: Solver
    ocp: OCP

    def __init_subclass__(cls, **options: Any) -> None:
        """Give every program the same one line, instead of all fields."""
        super().__init_subclass__(**options)
        if "__repr__" not in vars(cls):
            cls.__repr__ = BuiltProgram.__repr__

    def __repr__(self) -> str:
        """Return one line: of which problem, by which method."""
        return f"<Program of '{self.ocp.name}' by {type(self.solver).__name__}>"

    def __reduce__(self) -> tuple[Callable[..., Program], tuple[Solver, OCP]]:
        """Return what builds it again."""
        return _built, (self.solver, self.ocp)


def _built(solver: Solver, ocp: OCP) -> Program:
    return solver.prepare(ocp)


@overload
def solve(ocp: OCP, solver: Solver, *, guess: InitialGuess | None = None) -> Solution: ...


@overload
def solve(ocp: CompositeProblem[S], solver: Solver, *, guess: Any = None) -> S: ...


@interruptible
def solve(ocp: OCP | CompositeProblem[S], solver: Solver, *, guess: Any = None) -> Solution | S:
    """Solve a problem once: ``solver.build(ocp).run(guess=guess)``, with the build timed.

    Args:
        ocp: the problem, or ``Phases``.
        solver: the method with its options.
        guess: where to start; without one the problem's own guess, else the method's default. Of
            phases a sequence with one for each, or a solution of them.

    Returns:
        the solution, whatever its status; ``or_raise()`` insists on success.

    Raises:
        UnsupportedProblem: where the method cannot treat the problem, naming the term.
        ProblemError: if an argument is of another kind, or the guess does not fit.
    """
    if not isinstance(ocp, CompositeProblem):
        check_instance(ocp, OCP, "solve: ocp")
    check_instance(solver, Solver, "solve: solver")
    ocp.first_guess(guess)
    start = perf_counter()
    program = ocp.built_by(solver) if isinstance(ocp, CompositeProblem) else solver.build(ocp)
    build_time = perf_counter() - start
    return program.run(guess=guess).with_(build_time=build_time)
