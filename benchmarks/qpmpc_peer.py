"""The same problem by qpmpc [Caron et al. 2024]: its fastest way through a closed loop."""

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
import qpsolvers

from benchmarks import linear_speed as ours
from models import mass_spring_damper

if TYPE_CHECKING:
    from benchmarks.linear_speed import Situation


# Not among the requirements, so that its types are unknown.
_QPMPC: Any = import_module("qpmpc")


class QpmpcStep:
    """One step: update the initial state and both vectors, solve, read the first input.

    The matrices are made once. It constrains nodes 0 to N - 1; as in ``LinearMPC`` the measured
    state is left free, and node N is constrained through the state before it.
    """

    def __init__(self, steps: int, backend: str) -> None:
        """State the problem and condense it."""
        plant = mass_spring_damper().sampled(ours.DT)
        row, both = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([[1.0], [-1.0]])
        none, state, force = np.zeros((2, 2)), np.full(2, ours.BOUND), np.full(2, ours.FORCE)
        on_state = [none] + [np.vstack([none, row])] * (steps - 2)
        on_state.append(np.vstack([none, row, row @ plant.A]))
        on_input = [both] + [np.vstack([both, 0 * both])] * (steps - 2)
        on_input.append(np.vstack([both, 0 * both, row @ plant.B]))
        limits = [force] + [np.append(force, state)] * (steps - 2)
        limits.append(np.concatenate([force, state, state]))
        self._problem = _QPMPC.MPCProblem(
            transition_state_matrix=plant.A,
            transition_input_matrix=plant.B,
            ineq_state_matrix=on_state,
            ineq_input_matrix=on_input,
            ineq_vector=limits,
            nb_timesteps=steps,
            terminal_cost_weight=ours.END_WEIGHT,
            stage_state_cost_weight=ours.STATE_WEIGHT,
            stage_input_cost_weight=ours.INPUT_WEIGHT,
            initial_state=np.zeros(2),
            goal_state=np.zeros(2),
            target_states=np.zeros(2 * steps),
        )
        self._backend = backend
        self._program = _QPMPC.MPCQP(self._problem, sparse=backend in _SPARSE)

    def __call__(self, now: "Situation") -> float:
        """Return the first input at a situation."""
        problem, program = self._problem, self._program
        problem.update_initial_state(now.x)
        problem.update_target_states(now.ahead[:-1].ravel())
        problem.update_goal_state(now.ahead[-1])
        program.update_cost_vector(problem)
        program.update_constraint_vector(problem)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = qpsolvers.solve_problem(program.problem, solver=self._backend)
        return float("nan") if found.x is None else float(found.x[0])


# Backends that know sparse matrices only.
_SPARSE = ("osqp", "clarabel", "highs", "scs")
