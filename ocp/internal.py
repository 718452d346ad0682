"""What solvers, models and benchmarks build on, and users of solvers need not know."""

from ocp.checks.arguments import (
    check_callable,
    check_choice,
    check_flag,
    check_instance,
    check_not_negative,
    check_numbers,
    check_numeric,
    check_positive,
    check_real,
    check_whole,
)
from ocp.checks.interrupts import interruptible
from ocp.checks.progress import told
from ocp.checks.rich_text import html_of
from ocp.codegen.buffered_function import BufferedFunction
from ocp.codegen.buffered_nlp import QUIET, BufferedNlp
from ocp.codegen.compile import (
    Unbuildable,
    announce_interpreted,
    built_library,
    c_code,
    compiled,
)
from ocp.expressions.foreign_functions import external
from ocp.expressions.piecewise_constant import deciding, piecewise_constant, without_traces
from ocp.files.append import append_line
from ocp.files.checksum import with_checksum, without_checksum
from ocp.files.draft import replacing, write_file
from ocp.integration.differentiable_step import differentiable_step
from ocp.integration.one_step import Stage, interpolate, require_explicit
from ocp.integration.stage_hessian import stage_hessian
from ocp.integration.stage_tape import StageInputs, StageTape
from ocp.linear.linear_quadratic import LinearQuadratic, LQData, Matrices
from ocp.linear.stationary import stationary
from ocp.method.blocking_solver import BlockingSolver
from ocp.method.feedback_program import FeedbackMethodProgram
from ocp.method.in_normal_form import InNormalForm
from ocp.method.in_sizes import InSizes
from ocp.method.judged import judged
from ocp.method.least_violating import least_violating
from ocp.method.method_program import MethodProgram, RunResult
from ocp.method.method_solver import ACCURACY, MethodSolver
from ocp.method.rewriting import RewrittenProgram
from ocp.method.rewriting_of import rewriting_of
from ocp.method.scaling_solver import ScalingSolver
from ocp.method.with_slacks import WithSlacks
from ocp.minimum_principle.hamiltonian import hamiltonian
from ocp.minimum_principle.necessary_conditions import symbol_type
from ocp.nlp.transcription import Transcription
from ocp.nlp.violated_row import most_violated
from ocp.normal_form.normal_form import NormalForm, normal_form
from ocp.normal_form.origin import Origin
from ocp.phases.judged_phases import judged_phases
from ocp.phases.link import LinkRows
from ocp.problem.algebraic_controls import AlgebraicControls
from ocp.problem.called_functions import undefined_call
from ocp.problem.constraint_rows import (
    ConstraintRow,
    ConstraintRows,
    ImposedRows,
    Violation,
)
from ocp.problem.control_blocks import ControlBlocks
from ocp.problem.elastic import elastic
from ocp.problem.epigraph import Epigraph, epigraph
from ocp.problem.grid import check_intervals, cut, number_of
from ocp.problem.node_fractions import instant_fractions, node_fractions, node_widths
from ocp.problem.nominal_sizes import Sizes, time_unit
from ocp.problem.parameters import ParameterValues, Steps
from ocp.problem.portable import Portable
from ocp.problem.refusal import (
    refuse_compiled,
    refuse_free_ends,
    refuse_in_subprocess,
    refuse_state_bounds,
)
from ocp.problem.run_data import RunData
from ocp.problem.scaled import ScaledOCP, scaled, sizes_of, with_row_sizes
from ocp.problem.soft import excess
from ocp.problem.start_feasibility import start_violation
from ocp.problem.switches import switches
from ocp.problem.walk import applied, walk
from ocp.referee.integrate_controls import segment_gaps
from ocp.solution.jumps import Jump, jumps_along
from ocp.solution.piecewise_polynomial import PiecewisePolynomial, bernstein, elevated
from ocp.solution.shifted_plan import ShiftedPlan
from ocp.solution.solution import SAME_INSTANT
from ocp.solution.solver import BuiltProgram

__all__ = [
    "ACCURACY",
    "QUIET",
    "SAME_INSTANT",
    "AlgebraicControls",
    "BlockingSolver",
    "BufferedFunction",
    "BufferedNlp",
    "BuiltProgram",
    "ConstraintRow",
    "ConstraintRows",
    "ControlBlocks",
    "Epigraph",
    "FeedbackMethodProgram",
    "ImposedRows",
    "InNormalForm",
    "InSizes",
    "Jump",
    "LQData",
    "LinearQuadratic",
    "LinkRows",
    "Matrices",
    "MethodProgram",
    "MethodSolver",
    "NormalForm",
    "Origin",
    "ParameterValues",
    "PiecewisePolynomial",
    "Portable",
    "RewrittenProgram",
    "RunData",
    "RunResult",
    "ScaledOCP",
    "ScalingSolver",
    "ShiftedPlan",
    "Sizes",
    "Stage",
    "StageInputs",
    "StageTape",
    "Steps",
    "Transcription",
    "Unbuildable",
    "Violation",
    "WithSlacks",
    "announce_interpreted",
    "append_line",
    "applied",
    "bernstein",
    "built_library",
    "c_code",
    "check_callable",
    "check_choice",
    "check_flag",
    "check_instance",
    "check_intervals",
    "check_not_negative",
    "check_numbers",
    "check_numeric",
    "check_positive",
    "check_real",
    "check_whole",
    "compiled",
    "cut",
    "deciding",
    "differentiable_step",
    "elastic",
    "elevated",
    "epigraph",
    "excess",
    "external",
    "hamiltonian",
    "html_of",
    "instant_fractions",
    "interpolate",
    "interruptible",
    "judged",
    "judged_phases",
    "jumps_along",
    "least_violating",
    "most_violated",
    "node_fractions",
    "node_widths",
    "normal_form",
    "number_of",
    "piecewise_constant",
    "refuse_compiled",
    "refuse_free_ends",
    "refuse_in_subprocess",
    "refuse_state_bounds",
    "replacing",
    "require_explicit",
    "rewriting_of",
    "scaled",
    "segment_gaps",
    "sizes_of",
    "stage_hessian",
    "start_violation",
    "stationary",
    "switches",
    "symbol_type",
    "time_unit",
    "told",
    "undefined_call",
    "walk",
    "with_checksum",
    "with_row_sizes",
    "without_checksum",
    "without_traces",
    "write_file",
]
