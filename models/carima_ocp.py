"""Generalised predictive control stated as a discrete-time optimal control problem."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from models._numbers import vector
from models.carima import Carima
from ocp import OCP, Box, Constraint, Model, ProblemError, Signal
from ocp.internal import check_instance, check_not_negative, check_whole


def carima_ocp(
    model: Carima,
    *,
    reference: ArrayLike,
    weight: float,
    steps: int | None = None,
    outputs: ArrayLike = 0.0,
    inputs: ArrayLike = 0.0,
    noise: ArrayLike = 0.0,
    increment_bounds: Box | None = None,
    input_bounds: Box | None = None,
    output_bounds: Box | None = None,
) -> OCP:
    r"""State the problem of generalised predictive control as a discrete-time OCP.

    .. math::

        \min \; (y_N - w_N)^2 + \sum_{k=0}^{N-1} (y_k - w_k)^2 + \lambda \, \Delta u_k^2

    The state holds y(t) ... y(t - na), the last input u(t - 1), and the past increments and
    noises that still matter; the control is the increment. The term of k = 0 is a constant.
    With a dead time d the outputs up to k = d are constants too. Horizons: N1 = 1 and
    N2 = Nu = N; the last d increments change no output of the horizon and are 0.

    Source: thesis (2.60), without its misprints: the increments are weighed by lambda.

    Args:
        model: the plant.
        reference: w_0 ... w_N, (N + 1,), or one number for all.
        weight: lambda, not negative.
        steps: N; may be left out where ``reference`` has N + 1 numbers.
        outputs: measured outputs, oldest first and y(t) last; older ones equal the oldest.
        inputs: past inputs, oldest first and u(t - 1) last; older ones equal the oldest.
        noise: past e, oldest first and e(t) last; older ones are 0.
        increment_bounds: bounds on the increments.
        input_bounds: bounds on the inputs.
        output_bounds: bounds on the outputs, from k = 1 on.

    Raises:
        ProblemError: naming what is wrong.
    """
    check_instance(model, Carima, "carima: model")
    w = vector(reference, np.size(reference), "carima: reference")
    n = len(w) - 1 if steps is None else check_whole(steps, "carima: steps")
    w = np.full(n + 1, w[0]) if w.size == 1 else w
    if n < 1 or w.size != n + 1:
        raise ProblemError(f"carima: reference has {w.size} entries, {n + 1} are needed")
    layout = _Layout(model)
    symbol, control, target = ca.SX.sym("x", layout.size), ca.SX.sym("du"), ca.SX.sym("w")
    after = layout.next(symbol, control)
    miss = (symbol[0] - target) ** 2
    bound, output = input_bounds or Box(), output_bounds or Box()
    low = np.full(layout.size, -np.inf)
    state_bounds = (low.copy(), -low)
    held = bound.sized(1, "carima: input_bounds")
    for side, value in zip(state_bounds, (held.lower, held.upper), strict=True):
        side[layout.input] = np.asarray(value)[0]
    limits = (Constraint("output", symbol[0], output.lower, output.upper),)
    return OCP(
        name="generalised predictive control",
        model=Model(name="carima", x=symbol, u=control, f=after, dt=1.0),
        x0=layout.state(outputs, inputs, noise),
        horizon=n,
        running_cost=miss + check_not_negative(weight, "carima: weight") * control**2,
        terminal_cost=miss,
        control_bounds=increment_bounds or Box(),
        state_bounds=Box(*state_bounds),
        constraints=limits if output.sized(1, "carima: output_bounds").is_active else (),
        parameters=(Signal("reference", target, w),),
    )


@dataclass(frozen=True, eq=False)
class _Layout:
    """Where the state of a CARIMA model keeps what: outputs, increments, noises, last input."""

    model: Carima

    @property
    def outputs(self) -> int:
        """Outputs that are kept: na + 1."""
        return len(self.model.a)

    @property
    def increments(self) -> int:
        """Past increments that still matter: nb + d."""
        return len(self.model.b) - 1 + self.model.delay

    @property
    def noises(self) -> int:
        """Past noises that still matter: nc."""
        return len(self.model.c) - 1

    @property
    def input(self) -> int:
        """Place of the last input."""
        return self.size - 1

    @property
    def size(self) -> int:
        """Number of states."""
        return self.outputs + self.increments + self.noises + 1

    def next(self, x: ca.SX, du: ca.SX) -> ca.SX:
        """Return the state after one step with increment du and no new noise."""
        entries = ca.vertsplit(x)
        y, rest = entries[: self.outputs], entries[self.outputs : -1]
        past, e = rest[: self.increments], rest[self.increments :]
        a, model = np.convolve(self.model.a, [1.0, -1.0]), self.model
        recent = [du, *past]
        delayed = recent[model.delay : model.delay + len(model.b)]
        y_next = -ca.dot(ca.DM(a[1:]), ca.vertcat(*y))
        y_next += ca.dot(ca.DM(list(model.b)), ca.vertcat(*delayed))
        if self.noises:
            y_next += ca.dot(ca.DM(list(model.c[1:])), ca.vertcat(*e))
        e_next = [ca.SX(0), *e[:-1]] if self.noises else []
        # Lists, since CasADi slices a single symbol to a row (1, 0), which stacks as a row more.
        return ca.vertcat(y_next, *y[:-1], *recent[: self.increments], *e_next, entries[-1] + du)

    def state(self, outputs: ArrayLike, inputs: ArrayLike, noise: ArrayLike) -> np.ndarray:
        """Return the state of what was measured."""
        y = _latest(outputs, self.outputs, "outputs")
        u = _latest(inputs, self.increments + 1, "inputs")
        past = vector(noise, np.size(noise), "carima: noise")
        e = _latest(np.concatenate([[0.0], past]), self.noises, "noise")
        return np.concatenate([y, -np.diff(u), e, u[:1]])


def _latest(values: ArrayLike, count: int, what: str) -> np.ndarray:
    """Return the last ``count`` values, newest first; before the oldest it was the same."""
    given = vector(values, max(1, np.size(values)), f"carima: {what}")
    padded = np.concatenate([np.full(max(0, count - given.size), given[0]), given])
    return padded[::-1][:count]
