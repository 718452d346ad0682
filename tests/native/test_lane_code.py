"""CasADi Functions as C on lanes: every operation against CasADi's own, and what is refused."""

import ctypes

import casadi as ca
import numpy as np
import pytest

from ocp import RK4, Compiler, Table, UnsupportedProblem
from ocp.expressions.equations import solve_equations
from ocp.internal import Transcription, built_library
from solvers.direct.native.lane_code import lane_code
from solvers.direct.native.stage_code import StageCode, read
from tests.native.problems import free_time, swing, unbounded

A, B = ca.SX.sym("a"), ca.SX.sym("b")
SQUARED = ca.Function("squared", [A, B], [A**2 + B, A - B], {"never_inline": True})
OPERATIONS = [
    A + B, A - B, A * B, A / B, -A, A**2, 2 * A, 1 / A, A**B, ca.constpow(A, 3), ca.sqrt(A),
    ca.exp(A), ca.log(A), ca.sin(A), ca.cos(A), ca.tan(A), ca.asin(A), ca.acos(A), ca.atan(A),
    ca.sinh(A), ca.cosh(A), ca.tanh(A), ca.asinh(A), ca.acosh(A), ca.atanh(A), ca.erf(A),
    ca.log1p(A), ca.expm1(A), ca.floor(A), ca.ceil(A), ca.fabs(A), ca.sign(A), ca.fmod(A, B),
    ca.remainder(A, B), ca.copysign(A, B), ca.fmin(A, B), ca.fmax(A, B), ca.atan2(A, B),
    ca.hypot(A, B), ca.if_else(A, B, 7.0), A < B, A <= B, A == B, A != B, ca.logic_not(A),
    ca.logic_and(A, B), ca.logic_or(A, B), *SQUARED(A, B), ca.SX(np.inf) * A, ca.SX(0.1),
]  # fmt: skip
VALUES = np.array([-1e6, -9e3, -3.0, -1.0, -0.3, -0.0, 0.0, 1e-9, 0.7, 1.0, 2.0, 1e3, 1e5])
SPECIAL = np.array([np.inf, -np.inf, np.nan])
# The last place of libm, and of polynomials instead of it, grown in what is made of it.
LAST_PLACE = 1e-14

_RUN = """
void run(const double *in, double *out, int n) {
  for (int i = 0; i < n; i++) {
    V a[2] = {ALL(0.0), ALL(0.0)}, y[COUNT];
    for (int l = 0; l < LANES; l++) { LANE(a[0], l) = in[2 * i]; LANE(a[1], l) = in[2 * i + 1]; }
    every_operation(a, y);
    for (int j = 0; j < COUNT; j++) out[i * COUNT + j] = LANE(y[j], i % LANES);
  }
}
"""


def run(function: ca.Function, inputs: np.ndarray) -> np.ndarray:
    """Evaluate a function of two numbers in machine code, (n, 2) -> (n, m)."""
    count = function.nnz_out()
    code = [read("lanes"), f"#define COUNT {count}", lane_code([function], "these"), _RUN]
    library = ctypes.CDLL(str(built_library("\n".join(code), Compiler())))
    given, values = np.ascontiguousarray(inputs), np.empty((len(inputs), count))
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in (given, values)]
    library.run(*pointers, len(inputs))
    return values


def test_every_operation_gives_what_casadi_gives() -> None:
    function = ca.Function("every_operation", [A, B], [ca.densify(ca.vertcat(*OPERATIONS))])
    rng = np.random.default_rng(0)
    grid = np.concatenate([VALUES, SPECIAL, rng.normal(scale=3.0, size=8)])
    inputs = np.array([(a, b) for a in grid for b in grid])
    right = np.array([np.array(function(a, b)).ravel() for a, b in inputs])
    found = run(function, inputs)
    np.testing.assert_allclose(found, right, rtol=LAST_PLACE, atol=1e-300)


def test_sine_and_cosine_are_those_of_libm_to_the_last_place() -> None:
    function = ca.Function("every_operation", [A, B], [ca.vertcat(ca.sin(A), ca.cos(A))])
    rng = np.random.default_rng(1)
    near = np.concatenate([k * np.pi / 4 + 1e-9 * rng.normal(size=20) for k in range(-40, 40)])
    angles = np.concatenate([near, rng.uniform(-9.9e3, 9.9e3, size=5000), [2e4, 1e300]])
    found = run(function, np.column_stack([angles, angles]))
    right = np.column_stack([np.sin(angles), np.cos(angles)])
    np.testing.assert_array_less(np.abs(found - right), 2.5e-16 + 1e-300)


def test_functions_that_are_called_may_have_any_name() -> None:
    options = {"never_inline": True}
    parts = [A * B, A - B, ca.sin(A) + B, ca.fmin(A, B)]
    names = ["slope", "slope", "step", "exp"]
    called = [
        ca.Function(n, [A, B], [e, 2 * e], options) for n, e in zip(names, parts, strict=True)
    ]
    values = [value for each in called for value in each(A, B)]
    function = ca.Function("every_operation", [A, B], [ca.vertcat(*values)])
    inputs = np.array([(0.3, 1.7), (-2.0, 0.4)])
    right = [[m * float(ca.Function("e", [A, B], [e])(*ab)) for e in parts for m in (1, 2)]
             for ab in inputs]  # fmt: skip
    np.testing.assert_allclose(run(function, inputs), right, rtol=LAST_PLACE)


def test_a_stage_too_large_for_the_stack_is_refused_by_name() -> None:
    many = ca.SX.sym("many", 11_000)
    function = ca.Function("large", [many], [ca.sum1(many) * many])
    with pytest.raises(UnsupportedProblem, match="these: the stage is too large"):
        lane_code([function], "these")


def test_an_operation_without_c_is_refused_by_name() -> None:
    function = ca.Function("inverse", [A], [ca.erfinv(A)])
    with pytest.raises(UnsupportedProblem, match="these: the native backend cannot write"):
        lane_code([function], "these")


def test_functions_that_branch_are_called_a_lane_at_a_time() -> None:
    """A table and a root, with their derivatives; the root is no number where there is none."""
    table = Table(np.linspace(-3.0, 3.0, 9), np.cos(np.linspace(-3.0, 3.0, 9)), beyond="extend")
    root = ca.SX.sym("root")
    solved = solve_equations(ca.exp(root) + root - A * B, root, ca.SX(1.0)).values
    none = solve_equations(root**2 + 1.0 + A**2, root, ca.SX(1.0)).values
    values = ca.vertcat(table(A), solved)
    _, gradient = ca.hessian(ca.sum1(values), ca.vertcat(A, B))
    slopes = ca.vertcat(ca.jacobian(gradient, A), gradient)
    function = ca.Function(
        "every_operation", [A, B], [ca.densify(ca.vertcat(values, none, slopes))]
    )
    inputs = np.random.default_rng(0).uniform(0.2, 4.0, size=(9, 2))
    right = np.array([np.array(function(a, b)).ravel() for a, b in inputs])
    found = run(function, inputs)
    assert np.isnan(found[:, 2]).all()
    np.testing.assert_allclose(found, right, rtol=1e-9, atol=1e-12)


class _Python(ca.Callback):
    """A function whose code is in Python."""

    def __init__(self) -> None:
        ca.Callback.__init__(self)
        self.construct("opaque", {"enable_fd": True})


def test_a_function_of_python_is_refused_by_name() -> None:
    opaque = _Python()
    x = ca.MX.sym("x")
    inside = ca.Function("inside", [x], [2.0 * opaque(x)], {"never_inline": True})
    for called in (opaque, inside):
        function = ca.Function("outer", [A], [called(A)])
        with pytest.raises(UnsupportedProblem, match=r"these: .* no C of 'opaque'"):
            lane_code([function], "these")


@pytest.mark.parametrize("make", [swing, free_time, unbounded])
def test_functions_have_the_sizes_that_the_core_reads(make) -> None:
    code = StageCode(Transcription(make(), 3, RK4()))
    nx, nw, (nc, ni, ne) = code.nx, code.nx + code.nu, code.row_counts
    sizes = {
        "stage_value": nx + 1 + nc,
        "stage_slope": nx + 1 + nc + nx * nw + nw + nc * nw,
        "stage_full": nx + 1 + nc + nx * nw + nw + nc * nw + nw * nw,
        "stage_half": nx,
        "start_value": ni,
        "start_full": ni + ni * nw + nw * nw,
        "end_value": 1 + ne,
        "end_full": 1 + ne + nw + ne * nw + nw * nw,
    }
    assert {f.name(): f.nnz_out() for f in code.functions} == sizes
