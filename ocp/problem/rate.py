"""How fast controls may change, and what that costs."""

from collections.abc import Iterable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import check_numbers
from ocp.checks.errors import ProblemError
from ocp.checks.expressions import check_symbols, element_names
from ocp.problem.constraint import Box
from ocp.problem.model import Model
from ocp.problem.portable import Portable


@dataclass(frozen=True, eq=False)
class Rate(Portable):
    r"""Bounds of the rate of a control, and its price.

    .. math::

        \underline r \le \dot u \le \overline r, \quad J + \int w \, \dot u^2 \, dt
        \qquad \text{or} \qquad
        \underline r \le u_k - u_{k-1} \le \overline r, \quad J + \sum_k w \, (u_k - u_{k-1})^2

    In continuous time per second: such a control is continuous, and one that is held, and so jumps,
    has an infinite rate. In discrete time per step, from the last input on that was applied before
    the start, see ``OCP.last_input``.

    Args:
        control: of the model, one or some of its controls (m,).
        lower: least rate, a number or (m,).
        upper: largest rate, a number or (m,).
        weight: w, a number or (m,).

    Raises:
        ProblemError: if the weight is negative, no rate lies between the bounds, or there is
            neither bound nor weight.
    """

    control: ca.SX
    lower: ArrayLike = -np.inf
    upper: ArrayLike = np.inf
    weight: ArrayLike = 0.0

    def __post_init__(self) -> None:
        """Check symbols, bounds and weight."""
        control = check_symbols(self.control, "Rate: control")
        object.__setattr__(self, "control", control)
        names = element_names(control)
        size, what = len(names), f"rate of {', '.join(names)}"
        box = Box(self.lower, self.upper).sized(size, what)
        weight = check_numbers(self.weight, size, f"{what}: weight")
        if (weight < 0.0).any():
            raise ProblemError(f"{what}: weight = {weight}: it must be 0 or more")
        is_free = np.isinf(box.lower) & np.isinf(box.upper) & (weight == 0.0)
        for i in np.flatnonzero(is_free):
            raise ProblemError(
                f"rate of {names[i]}: neither a bound nor a weight: give one, or leave it out"
            )
        for name, value in (("lower", box.lower), ("upper", box.upper), ("weight", weight)):
            object.__setattr__(self, name, value)


@dataclass(frozen=True, eq=False)
class ControlRates:
    """The rates of a problem, stacked in the order of its controls.

    Attributes:
        index: which controls have one, ascending, (m,).
        names: of the rates.
        box: their bounds, each (m,).
        weight: their prices (m,).
    """

    index: np.ndarray
    names: tuple[str, ...]
    box: Box
    weight: np.ndarray

    @classmethod
    def of(cls, owner: str, model: Model, rates: Iterable[Rate]) -> "ControlRates":
        """Stack them.

        Raises:
            ProblemError: if one is of no control, or a control has two.
        """
        controls = [e.element_hash() for e in ca.vertsplit(model.u)]
        found: dict[int, tuple[float, float, float]] = {}
        for rate in rates:
            rows = (np.asarray(v) for v in (rate.lower, rate.upper, rate.weight))
            for symbol, row in zip(ca.vertsplit(rate.control), np.stack([*rows], 1), strict=True):
                if symbol.element_hash() not in controls:
                    raise ProblemError(
                        f"{owner}: a Rate of '{symbol}', which is no control; they are "
                        f"{', '.join(model.u_names) or 'none'}"
                    )
                i = controls.index(symbol.element_hash())
                if i in found:
                    raise ProblemError(f"{owner}: two rates of '{symbol}'")
                found[i] = tuple(row.tolist())
        index = np.array(sorted(found), dtype=int)
        lower, upper, weight = np.array([found[i] for i in index]).reshape(-1, 3).T
        names = tuple(f"rate of {model.u_names[i]}" for i in index)
        return cls(index, names, Box(lower, upper), weight)

    def __len__(self) -> int:
        """Return how many controls have one."""
        return len(self.index)
