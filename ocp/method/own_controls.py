"""The controls of a problem along a solution of its normal form, in which some may be states."""

from typing import Any

import numpy as np

from ocp.normal_form.normal_form import NormalForm
from ocp.solution.piecewise_polynomial import antiderivative, elevated
from ocp.solution.solution import Solution


def own_controls(form: NormalForm, found: Solution) -> dict[str, Any]:
    """Return u, control_kind and breaks of a solution in the terms of the user.

    A control that is a state moves: linearly where its rate is held, else as a polynomial of one
    degree more than its rate. Beside one that is linear a held control is a polynomial too.
    """
    u = form.own_controls(found.x, found.u) if len(found.u) == len(found.x) else None
    if found.control_kind == "extremal":
        return {"u": u}
    if not len(form.rates):
        return {"u": found.u[:, form.controls - found.x.shape[1]]}
    if found.control_kind == "held" and len(form.rates) == len(form.controls):
        return {"u": found.x[:, form.controls], "control_kind": "linear"}
    breaks, coefficients = _pieces(found)
    nx, values = found.x.shape[1], found.x[breaks]
    count, widths = coefficients.shape[1] + 1, np.diff(found.t[breaks])
    columns, rates = [], iter(form.rates)
    for at in form.controls:
        if at < nx:
            rate = coefficients[:, :, next(rates)]
            columns.append(antiderivative(rate, widths, values[:, at]).ravel())
        else:
            each = [elevated(piece[:, [at - nx]], count) for piece in coefficients]
            columns.append(np.concatenate(each).ravel())
    return {"u": np.stack(columns, axis=1), "control_kind": "polynomial", "breaks": breaks}


def _pieces(found: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Return where the polynomials of the controls meet, and their coefficients (K, m, nu)."""
    nodes = np.arange(len(found.t))
    match found.control_kind:
        case "held":
            return nodes, found.u[:, None, :]
        case "linear":
            return nodes, np.stack([found.u[:-1], found.u[1:]], axis=1)
        case _:
            return found.breaks, found.pieces.coefficients
