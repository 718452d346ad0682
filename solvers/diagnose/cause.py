"""What can be wrong with a problem, causes before their consequences."""

from enum import Enum


class Cause(Enum):
    """Why a problem cannot be solved, or why its answer is not what was meant.

    The order is that of explanation: between findings of one severity the earlier cause is
    named first, since it makes the later ones happen.
    """

    NOT_FINITE = "a function or its derivative is not finite where the solver starts"
    DEGREES = "an angle in radians has numbers that look like degrees"
    TIME_KIND = "continuous and discrete time are mixed up"
    VACUOUS = "a constraint without effect"
    START_VIOLATES = "the start itself violates a constraint"
    CONTRADICTION = "constraints exclude each other at one instant"
    NO_INFLUENCE = "a control that moves nothing"
    UNREACHABLE = "no control can lead a state to where it has to end"
    WRONG_SIGN = "the cost rewards being far away: a weight has the wrong sign"
    LINEAR_COST = "the cost is linear in an unbounded control"
    FREE_CONTROL = "an unbounded control costs nothing"
    VANISHING_TIME = "the free final time shrinks to nothing"
    ENDLESS_TIME = "the free final time grows without end"
    UNBOUNDED = "the cost falls without limit"
    OUT_OF_REACH = "the end cannot be reached in time within the bounds"
    CONFLICT = "constraints exclude each other along the whole trajectory"
    DUPLICATE = "constraints say the same thing twice"
    OUTLIER = "a measured value far from all others"
    COARSE_GRID = "the dynamics are faster than the grid"
    BAD_SCALING = "quantities of very different size"
    KINK = "a kink or a jump, which derivatives do not see"
    GUESS_OUTSIDE = "the guess violates the bounds"
    STATIONARY_GUESS = "the start of the solver is stationary, but no minimum"
    UNIDENTIFIABLE = "constants that nothing tells apart"
    CHEAP_SOFT = "a soft constraint that costs too little to matter"
    UNUSED = "declared but never used"
    NO_GOAL = "nothing asks for a motion: the optimum is to do nothing"
    INACTIVE = "a constraint that never acts"
    SATURATED = "a control that sits on its bound all the time"
    UNSOLVED = "the solver failed, and no check knows why"
