"""The options of fatrop for one problem, and what it cannot take."""

from typing import Any

import casadi as ca

from ocp import UnsupportedProblem
from ocp.internal import Transcription
from solvers.direct.nlp_result import HUGE
from solvers.direct.transcribed_problem import TranscribedProblem


def fatrop_options(transcription: TranscribedProblem, tolerance: float) -> dict[str, Any]:
    """Return the options of ``casadi.nlpsol`` that are fatrop's own.

    Raises:
        UnsupportedProblem: for what fatrop cannot treat.
    """
    if not isinstance(transcription, Transcription):
        raise UnsupportedProblem("fatrop takes the stages of multiple shooting alone")
    _refuse_for_fatrop(transcription)
    return {
        "structure_detection": "auto",
        "equality": [row.is_equation for row in transcription.rows],
        "fatrop.tolerance": tolerance,
        "cache": {"nlp_grad": _clamped_values(transcription)},
    }


def _clamped_values(transcription: TranscribedProblem) -> ca.Function:
    """Return cost, constraints and their gradients, as fatrop ends with them; NaN is -1e300.

    Where one of them is not finite CasADi prints a warning, and no option turns that off.
    """
    program = transcription.program
    nlp = ca.Function("nlp", program, ["x", "p"], ["f", "g"])
    names = ["x", "p", "lam:f", "lam:g"], ["f", "g", "grad:gamma:x", "grad:gamma:p"]
    exact = nlp.factory("exact", *names, {"gamma": ["f", "g"]})
    inputs = exact.mx_in()
    f, g, *gradients = exact.call(inputs)
    values = [ca.fmin(ca.fmax(value, -HUGE), HUGE) for value in (f, g)]
    own_names = exact.name_in(), exact.name_out()
    return ca.Function("nlp_grad", inputs, [*values, *gradients], *own_names)


def _refuse_for_fatrop(transcription: Transcription) -> None:
    """Refuse problems that fatrop would end with a printed assertion of its own."""
    ocp, n = transcription.ocp, transcription.n
    if any(not c.is_equation for c in ocp.at("initial")):
        raise UnsupportedProblem(f"{ocp.name}: fatrop takes no inequality at the start; use ipopt")
    for node, unknowns in ((0, transcription.nz + ocp.model.nu), (n, transcription.nz)):
        rows = [r for r in transcription.rows if r.node == node and r.is_equation]
        rows = [r for r in rows if r.place in ("path", "initial", "terminal")]
        if len(rows) > unknowns:
            raise UnsupportedProblem(
                f"{ocp.name}: {len(rows)} equations for {unknowns} unknowns at node {node} "
                f"(the last is '{rows[-1].name}'); fatrop takes no more equations than unknowns"
            )
