"""What an optimal control problem is, and what is true of it whoever solves it."""

from ocp.assembled import assembled
from ocp.buffered import Buffered
from ocp.compile import Compiler, InterpretedWarning, c_code, compiled
from ocp.constraint import Box, Constraint
from ocp.curvature import curvature
from ocp.data import Data
from ocp.errors import OCPError, ProblemError, SolverError, UnsupportedProblem
from ocp.expressions import function, instance, not_negative, numbers, positive, real, whole
from ocp.functions import Functions
from ocp.given_start import start_fault
from ocp.guess import Guess
from ocp.hamiltonian import Hamiltonian, hamiltonian
from ocp.integrate import RK4, Euler, Integrator, Midpoint, Stage, interpolate
from ocp.linear.discretise import discretise
from ocp.linear.input_rate import with_input_rate
from ocp.linear.linear_quadratic import LinearQuadratic, LQData, Matrices
from ocp.linear.stationary import Stationary, stationary, with_stationary_end
from ocp.linear.structure import linear_quadratic
from ocp.linear.terminal_set import Polyhedron, terminal_set, with_terminal_set
from ocp.model import Model
from ocp.mpc.applied import Applied
from ocp.mpc.backup import instantaneous, saturated_lqr
from ocp.mpc.decision import Attempt, Controller, ControlRefused, Decision, Outcome
from ocp.mpc.driver import MPC
from ocp.mpc.law import Law
from ocp.mpc.loop import closed_loop
from ocp.mpc.plant import Plant
from ocp.mpc.record import Record, records
from ocp.mpc.recorder import FlightRecorder, Replay, replay, replay_all
from ocp.mpc.rollout import Rollout
from ocp.optimality import Optimality, derive, symbol_kind
from ocp.parameters import Parameter, ParameterValues, Signal
from ocp.pieces import Pieces, bernstein, elevated
from ocp.problem import OCP, FreeTime
from ocp.referee.evaluate import Evaluation, costates_along, evaluate
from ocp.rows import Row, most_violated, rows_of
from ocp.solution import Solution, Work
from ocp.solver import Program, Solver, Start, solve
from ocp.status import Status
from ocp.transcription import Transcription

__all__ = [
    "MPC",
    "OCP",
    "RK4",
    "Applied",
    "Attempt",
    "Box",
    "Buffered",
    "Compiler",
    "Constraint",
    "ControlRefused",
    "Controller",
    "Data",
    "Decision",
    "Euler",
    "Evaluation",
    "FlightRecorder",
    "FreeTime",
    "Functions",
    "Guess",
    "Hamiltonian",
    "Integrator",
    "InterpretedWarning",
    "LQData",
    "Law",
    "LinearQuadratic",
    "Matrices",
    "Midpoint",
    "Model",
    "OCPError",
    "Optimality",
    "Outcome",
    "Parameter",
    "ParameterValues",
    "Pieces",
    "Plant",
    "Polyhedron",
    "ProblemError",
    "Program",
    "Record",
    "Replay",
    "Rollout",
    "Row",
    "Signal",
    "Solution",
    "Solver",
    "SolverError",
    "Stage",
    "Start",
    "Stationary",
    "Status",
    "Transcription",
    "UnsupportedProblem",
    "Work",
    "assembled",
    "bernstein",
    "c_code",
    "closed_loop",
    "compiled",
    "costates_along",
    "curvature",
    "derive",
    "discretise",
    "elevated",
    "evaluate",
    "function",
    "hamiltonian",
    "instance",
    "instantaneous",
    "interpolate",
    "linear_quadratic",
    "most_violated",
    "not_negative",
    "numbers",
    "positive",
    "real",
    "records",
    "replay",
    "replay_all",
    "rows_of",
    "saturated_lqr",
    "solve",
    "start_fault",
    "stationary",
    "symbol_kind",
    "terminal_set",
    "whole",
    "with_input_rate",
    "with_stationary_end",
    "with_terminal_set",
]
