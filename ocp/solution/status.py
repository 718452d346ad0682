"""How a solve ended, in a sentence the user can act on."""

from enum import Enum


class Status(Enum):
    """The outcome of a solve; only the first two are successes."""

    #: Success. A direct method has checked curvature where its iterates went, no further; a
    #: polished extremal has passed the second-order test of the problem itself.
    SOLVED = "the optimality conditions hold, with curvature as far as the method checks it"
    #: Success: a zero of the necessary conditions.
    STATIONARY = "the first-order conditions hold; whether it is a minimum is not known: polish it"
    #: Greedy control: no step could be better, the trajectory could.
    MYOPIC = (
        "every step is the best one by itself, the trajectory is not: use a solver that looks ahead"
    )
    #: The thesis' second termination condition.
    SMALL_DECREASE = (
        "stopped because the cost fell too little in one step; it need not be a minimum: "
        "tighten the threshold or use a line search"
    )
    #: The thesis' third termination condition.
    COST_ROSE = "stopped because the cost rose; the best iterate is returned: take a smaller step"
    #: Stopped before the tolerance was met.
    ITERATION_LIMIT = "not converged within the iteration limit: raise it or start closer"
    #: Stopped before the tolerance was met, with the iterate it had.
    TIME_LIMIT = "not converged within the time limit: raise it or start closer"
    #: No step of a line search or of a damped Newton method was accepted.
    NO_PROGRESS = "no step improves the iterate: start closer, use continuation or a direct method"
    #: A number that is not finite, or iterates without bound.
    DIVERGED = "the iterates blew up: start closer, or use continuation or more segments"
    #: The message says where.
    INACCURATE = (
        "the integrator's error is too large for the answer to mean anything: take more "
        "intervals or more integration steps"
    )
    #: The message names the constraint, and when.
    INFEASIBLE = "no trajectory near this one meets the constraints: relax the one that is named"
    #: Anything else.
    FAILED = "no solution for another reason, which the message gives"

    @property
    def is_success(self) -> bool:
        """Whether the trajectory meets the first-order conditions of the problem."""
        return self in (Status.SOLVED, Status.STATIONARY)

    @property
    def words(self) -> str:
        """How it ended in a few plain words, for a title."""
        return _WORDS.get(self, self.name.lower().replace("_", " "))


_WORDS = {
    Status.SOLVED: "solved",
    Status.STATIONARY: "stationary (first-order conditions hold)",
    Status.MYOPIC: "best step by step, not as a whole",
    Status.SMALL_DECREASE: "not converged: the cost fell too little",
    Status.COST_ROSE: "not converged: the cost rose",
    Status.ITERATION_LIMIT: "not converged: too few iterations",
    Status.TIME_LIMIT: "not converged: out of time",
    Status.NO_PROGRESS: "not converged: no step helps",
    Status.DIVERGED: "failed: the iterates blew up",
    Status.INACCURATE: "not accurate: too few intervals",
    Status.INFEASIBLE: "infeasible: the constraints are not met",
    Status.FAILED: "failed",
}
