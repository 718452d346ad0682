"""Terms of a problem that have no meaning in a control loop: they are of one horizon alone."""

from ocp.checks.errors import UnsupportedProblem
from ocp.mpc.plant_input import PlantInput
from ocp.problem.ocp import OCP


def refuse_terms_of_one_horizon(ocp: OCP, applied: PlantInput) -> None:
    """Refuse what has no meaning over a horizon that moves with time.

    Args:
        ocp: the problem over one horizon.
        applied: what the plant receives.

    Raises:
        UnsupportedProblem: naming the term, and what to write instead.
    """
    name = ocp.name
    if ocp.unknowns:
        raise UnsupportedProblem(
            f"MPC of {name}: '{ocp.unknowns[0].name}' is an unknown constant, which every "
            "step would choose anew: solve for it once, and make it a Parameter of that value"
        )
    if at_instants := ocp.at("instants"):
        raise UnsupportedProblem(
            f"MPC of {name}: '{at_instants[0].name}' holds at instants of one horizon, a "
            "loop's moves: write at='path' with a signal of the horizon that says when it holds"
        )
    if ocp.data:
        raise UnsupportedProblem(
            f"MPC of {name}: the data '{ocp.data[0].name}' are of one horizon, a "
            "loop's moves: estimate first, and make what was unknown a Parameter"
        )
    if integrals := ocp.at("integral"):
        raise UnsupportedProblem(
            f"MPC of {name}: the integral constraint '{integrals[0].name}' would begin anew at "
            "every step: carry the integral as a state, bounded at the end"
        )
    if ocp.delays:
        raise UnsupportedProblem(
            f"MPC of {name}: a loop keeps what is on its way itself: leave the Delay of "
            f"'{ocp.delays[0].control}' out, and say MPC(delay=...) [s]"
        )
    if ocp.rates and ocp.last_input is None:
        raise UnsupportedProblem(
            f"MPC of {name}: the last input is free, here it is what was applied; say what it "
            "is before the first step: last_input=..."
        )
    if ocp.rates and applied.what != "control":
        raise UnsupportedProblem(
            f"MPC of {name}: the rates are those of controls, and no control is applied"
        )
    if ocp.refers_to_start:
        raise UnsupportedProblem(
            f"MPC of {name}: a term contains the state at the start, which every step moves"
        )
