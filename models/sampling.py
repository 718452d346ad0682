"""An expression in time and parameters, looked at all along the horizon."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from ocp import Parameter, ProblemError, Signal
from ocp.internal import ParameterValues

_INSTANTS = 1001


def sampled(
    expression: ca.SX,
    t: ca.SX,
    horizon: float,
    parameters: Sequence[Parameter | Signal],
    what: str,
) -> tuple[np.ndarray, np.ndarray]:
    """Return instants (K,) [s] and the expression there (K, m), with the declared parameters.

    Raises:
        ProblemError: if the expression has another symbol, naming it and ``what``.
    """
    symbols = ca.vertcat(ca.SX(0, 1), *[entry.symbol for entry in parameters])
    known = {s.element_hash() for s in ca.vertsplit(ca.vertcat(t, symbols))}
    foreign = [str(s) for s in ca.symvar(expression) if s.element_hash() not in known]
    if foreign:
        raise ProblemError(f"{what} contains {', '.join(foreign)}, neither t nor a parameter")
    shares = np.linspace(0.0, 1.0, _INSTANTS)
    values = ParameterValues.of(parameters, None).at(shares)
    function = ca.Function("sampled", [t, symbols], [ca.densify(expression)]).map(_INSTANTS)
    times = shares * horizon
    return times, np.array(function(times[None, :], values.T)).T
