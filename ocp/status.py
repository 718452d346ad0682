"""How a solve ended, in a sentence the user can act on."""

from enum import Enum


class Status(Enum):
    """The outcome of a solve; only the first two stand behind the trajectory."""

    SOLVED = "a local minimum: the optimality conditions hold, and so does the second-order test"
    STATIONARY = "the first-order conditions hold; whether it is a minimum is not known: polish it"
    SMALL_DECREASE = (
        "stopped because the cost fell too little in one step; it need not be a minimum: "
        "tighten the threshold or use a line search"
    )
    COST_ROSE = "stopped because the cost rose; the best iterate is returned: take a smaller step"
    ITERATION_LIMIT = "not converged within the iteration limit: raise it or start closer"
    NO_PROGRESS = "no step improves the iterate: start closer, use continuation or a direct method"
    DIVERGED = "the iterates blew up: start closer, or use continuation or more segments"
    INFEASIBLE = "no trajectory near this one meets the constraints: relax the one that is named"
    FAILED = "the numerical backend stopped for another reason, which the message gives"

    @property
    def is_success(self) -> bool:
        """Whether the trajectory meets the first-order conditions of the problem."""
        return self in (Status.SOLVED, Status.STATIONARY)
