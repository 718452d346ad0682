"""What the backends' return values mean: one table from word to status and sentence."""

from typing import NamedTuple

from ocp import Status


class ReturnWord(NamedTuple):
    """What a backend's return value means.

    Attributes:
        status: of the answer, unless the answer itself shows that it is better or worse.
        sentence: for the user.
    """

    status: Status
    sentence: str


ACCEPTABLE = "Solved_To_Acceptable_Level"
_SINGULAR = "its linear system is singular or its derivatives are wrong"

_WORDS: dict[tuple[str, str], ReturnWord] = {
    ("ipopt", "Solve_Succeeded"): ReturnWord(Status.SOLVED, ""),
    ("ipopt", ACCEPTABLE): ReturnWord(
        Status.FAILED, "it stopped at a point that is acceptable only after its own scaling"
    ),
    ("ipopt", "Infeasible_Problem_Detected"): ReturnWord(
        Status.FAILED, "it converged to a point where the constraints' violation is least, not zero"
    ),
    ("ipopt", "Search_Direction_Becomes_Too_Small"): ReturnWord(
        Status.FAILED, "its steps became too small: rounding errors, or a badly scaled problem"
    ),
    ("ipopt", "Diverging_Iterates"): ReturnWord(
        Status.DIVERGED, "its iterates grow without bound: the cost may be unbounded below"
    ),
    ("ipopt", "User_Requested_Stop"): ReturnWord(Status.FAILED, "it was asked to stop"),
    ("ipopt", "Feasible_Point_Found"): ReturnWord(
        Status.FAILED, "it found a point that meets the constraints and no optimum"
    ),
    ("ipopt", "Maximum_Iterations_Exceeded"): ReturnWord(
        Status.ITERATION_LIMIT, "its iteration limit was reached"
    ),
    ("ipopt", "Maximum_CpuTime_Exceeded"): ReturnWord(
        Status.TIME_LIMIT, "its time limit was reached"
    ),
    ("ipopt", "Maximum_WallTime_Exceeded"): ReturnWord(
        Status.TIME_LIMIT, "its time limit was reached"
    ),
    ("ipopt", "Restoration_Failed"): ReturnWord(
        Status.FAILED, "it found no point that violates the constraints less"
    ),
    ("ipopt", "Error_In_Step_Computation"): ReturnWord(
        Status.FAILED, f"it could compute no step: {_SINGULAR}"
    ),
    ("ipopt", "Not_Enough_Degrees_Of_Freedom"): ReturnWord(
        Status.FAILED, "there are more equations than unknowns"
    ),
    ("ipopt", "Invalid_Problem_Definition"): ReturnWord(
        Status.FAILED, "a lower bound lies above an upper one"
    ),
    ("ipopt", "Invalid_Option"): ReturnWord(Status.FAILED, "it does not know one of its options"),
    ("ipopt", "Invalid_Number_Detected"): ReturnWord(
        Status.FAILED, "a derivative of cost, dynamics or constraints is not finite"
    ),
    ("ipopt", "Insufficient_Memory"): ReturnWord(Status.FAILED, "memory does not suffice"),
    ("native", "solved"): ReturnWord(Status.SOLVED, ""),
    ("native", "iteration limit"): ReturnWord(
        Status.ITERATION_LIMIT, "its iteration limit was reached"
    ),
    ("native", "no step"): ReturnWord(Status.FAILED, "no step was accepted"),
    ("native", "not finite"): ReturnWord(
        Status.FAILED, "a value or derivative of cost, dynamics or constraints is not finite"
    ),
    ("native", "time limit"): ReturnWord(Status.TIME_LIMIT, "its time limit was reached"),
    ("native", "diverged"): ReturnWord(
        Status.DIVERGED, "its iterates grow without bound: the cost may be unbounded below"
    ),
    ("fatrop", "0"): ReturnWord(Status.SOLVED, ""),
    ("fatrop", "1"): ReturnWord(
        Status.FAILED, f"no step was accepted, or the iteration limit was reached: {_SINGULAR}"
    ),
}


def meaning(backend: str, word: str) -> ReturnWord:
    """Return what a return value of a backend means; of an unknown one the word itself."""
    unknown = ReturnWord(Status.FAILED, f"it ended with '{word}'" if word else "it gave no reason")
    return _WORDS.get((backend, word), unknown)
