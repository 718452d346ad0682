"""What an optimal control problem is, and what is true of it whoever solves it."""

from ocp.checks.errors import DamagedFile, OCPError, ProblemError, SolverError, UnsupportedProblem
from ocp.checks.progress import Interrupted, Progress, TextProgress
from ocp.closed_loop.constraint_table import ConstraintTable
from ocp.closed_loop.decision import Controller, ControlRefused, Decision, InputSource, StepReport
from ocp.closed_loop.feedback_law import FeedbackLaw
from ocp.closed_loop.plant import Plant
from ocp.closed_loop.rollout import Rollout
from ocp.closed_loop.simulate import closed_loop
from ocp.codegen.compile import Compiler, InterpretedWarning
from ocp.estimation.estimate import Estimate, estimate
from ocp.expressions.network import Network
from ocp.expressions.table import Table
from ocp.files.archive import whole_arrays
from ocp.integration.implicit_step import Radau
from ocp.integration.one_step import RK4, Euler, Integrator, Midpoint
from ocp.linear.discretise import discretise
from ocp.linear.stationary import with_stationary_end
from ocp.linear.structure import linear_quadratic
from ocp.linear.terminal_set import Polyhedron, terminal_set, with_terminal_set
from ocp.minimum_principle.necessary_conditions import MinimumPrinciple, minimum_principle
from ocp.mpc.backup_laws import instantaneous, saturated_lqr
from ocp.mpc.flight_recorder import FlightRecorder, Replay, replay, replay_all
from ocp.mpc.mpc import MPC
from ocp.mpc.plant_input import PlantInput
from ocp.mpc.record_file import records
from ocp.mpc.record_format import Record
from ocp.phases.link import Link
from ocp.phases.phases import Phases
from ocp.phases.phases_evaluation import PhasesEvaluation
from ocp.phases.phases_solution import PhasesSolution
from ocp.problem.constraint import Box, Constraint, Soft
from ocp.problem.delay import Delay
from ocp.problem.epigraph import without_kinks
from ocp.problem.free_time import FreeTime
from ocp.problem.grid import Grid
from ocp.problem.guess import Guess
from ocp.problem.measurement import Measurement
from ocp.problem.model import Model
from ocp.problem.ocp import OCP
from ocp.problem.parameters import Parameter, Signal, Unknown
from ocp.problem.peak import Peak
from ocp.problem.rate import Rate
from ocp.referee.evaluate import Evaluation, costates_along, evaluate
from ocp.solution.solution import Solution
from ocp.solution.solver import InitialGuess, Program, Solver, solve
from ocp.solution.status import Status
from ocp.solution.work import Work

__all__ = [
    "MPC",
    "OCP",
    "RK4",
    "Box",
    "Compiler",
    "Constraint",
    "ConstraintTable",
    "ControlRefused",
    "Controller",
    "DamagedFile",
    "Decision",
    "Delay",
    "Estimate",
    "Euler",
    "Evaluation",
    "FeedbackLaw",
    "FlightRecorder",
    "FreeTime",
    "Grid",
    "Guess",
    "InitialGuess",
    "InputSource",
    "Integrator",
    "InterpretedWarning",
    "Interrupted",
    "Link",
    "Measurement",
    "Midpoint",
    "MinimumPrinciple",
    "Model",
    "Network",
    "OCPError",
    "Parameter",
    "Peak",
    "Phases",
    "PhasesEvaluation",
    "PhasesSolution",
    "Plant",
    "PlantInput",
    "Polyhedron",
    "ProblemError",
    "Program",
    "Progress",
    "Radau",
    "Rate",
    "Record",
    "Replay",
    "Rollout",
    "Signal",
    "Soft",
    "Solution",
    "Solver",
    "SolverError",
    "Status",
    "StepReport",
    "Table",
    "TextProgress",
    "Unknown",
    "UnsupportedProblem",
    "Work",
    "closed_loop",
    "costates_along",
    "discretise",
    "estimate",
    "evaluate",
    "instantaneous",
    "linear_quadratic",
    "minimum_principle",
    "records",
    "replay",
    "replay_all",
    "saturated_lqr",
    "solve",
    "terminal_set",
    "whole_arrays",
    "with_stationary_end",
    "with_terminal_set",
    "without_kinks",
]
