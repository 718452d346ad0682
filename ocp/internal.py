"""What solvers, models and benchmarks build on, and users of solvers need not know."""

from ocp.checks.arguments import (
    check_callable,
    check_choice,
    check_flag,
    check_instance,
    check_not_negative,
    check_numbers,
    check_positive,
    check_real,
    check_whole,
)
from ocp.codegen.buffered_function import BufferedFunction
from ocp.codegen.compile import c_code, compiled
from ocp.integration.differentiable_step import differentiable_step
from ocp.integration.one_step import Stage, interpolate
from ocp.integration.stage_hessian import stage_hessian
from ocp.linear.linear_quadratic import LinearQuadratic, LQData, Matrices
from ocp.linear.stationary import stationary
from ocp.minimum_principle.hamiltonian import hamiltonian
from ocp.minimum_principle.necessary_conditions import symbol_type
from ocp.nlp.program_rows import most_violated
from ocp.nlp.transcription import Transcription
from ocp.problem.constraint_rows import ConstraintRow, ConstraintRows, Violation
from ocp.problem.parameters import ParameterValues
from ocp.problem.run_data import RunData
from ocp.problem.start_feasibility import start_violation
from ocp.solution.jumps import Jump, jumps_along
from ocp.solution.method_program import MethodProgram, RunResult
from ocp.solution.piecewise_polynomial import PiecewisePolynomial, bernstein, elevated

__all__ = [
    "BufferedFunction",
    "ConstraintRow",
    "ConstraintRows",
    "Jump",
    "LQData",
    "LinearQuadratic",
    "Matrices",
    "MethodProgram",
    "ParameterValues",
    "PiecewisePolynomial",
    "RunData",
    "RunResult",
    "Stage",
    "Transcription",
    "Violation",
    "bernstein",
    "c_code",
    "check_callable",
    "check_choice",
    "check_flag",
    "check_instance",
    "check_not_negative",
    "check_numbers",
    "check_positive",
    "check_real",
    "check_whole",
    "compiled",
    "differentiable_step",
    "elevated",
    "hamiltonian",
    "interpolate",
    "jumps_along",
    "most_violated",
    "stage_hessian",
    "start_violation",
    "stationary",
    "symbol_type",
]
