"""The whole C of a problem under a strict compiler and sanitizers, called from C."""

import shlex
from pathlib import Path

import numpy as np
import pytest

from ocp import RK4, Compiler, solve
from ocp.codegen.run_limited import run_limited
from ocp.internal import RunData, Transcription, scaled
from solvers import MultipleShooting
from solvers.direct.native.flat_rows import FlatRows
from solvers.direct.native.native_library import NativeLibrary
from solvers.direct.native.stage_code import StageCode
from tests.native.problems import free_time, swing

N = 10
# Solves of a batch: no multiple of the lanes, the last from states that are given.
MANY = 6
STRICT = ["-std=gnu11", "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined"]

# Reads what the caller of a solve writes, solves in memory of its own, and prints the cost.
_MAIN = """
#include <stdio.h>
#include <stdlib.h>
int main(void) {
  char *block = aligned_alloc(64, (native_bytes(INTERVALS) + 63) / 64 * 64);
  double *arrays[31];
  native_set_up(block, INTERVALS);
  native_arrays(block, arrays);
  memcpy(arrays[0], x, sizeof x);
  memcpy(arrays[1], u, sizeof u);
  memcpy(arrays[3], data, sizeof data);
  memcpy(arrays[4], low, sizeof low);
  memcpy(arrays[5], up, sizeof up);
  memcpy(arrays[10], x_given, sizeof x_given);
  native_read_bounds(block);
  const Options options = {1e-9, 0.1, 300.0, INFINITY, INFINITY, 0.0, 0.0, 0.0};
  double report[13];
  const int ending = native_solve(block, &options, 1);
  native_report(block, report);
  printf("%d %.12e", ending, report[0]);
  /* The same many times, in memory that ends with the last of them. */
  const size_t states = (INTERVALS + 1) * NX, controls = INTERVALS * NU;
  double *xs = calloc(MANY * states, sizeof(double)), *us = calloc(MANY * controls, sizeof(double));
  double *lambdas = calloc(MANY * states, sizeof(double));
  double *made = calloc(MANY * MADE, sizeof(double));
  int own_data = 0, *has_states = calloc(MANY, sizeof(int)), *warm = calloc(MANY, sizeof(int));
  volatile int stop = 0;
  for (size_t i = 0; i < MANY; i++) {
    memcpy(xs + i * states, x, sizeof x);
    memcpy(us + i * controls, u, sizeof u);
    has_states[i] = i % 2;
  }
  const Batch batch = {xs, us, lambdas, data, &own_data, has_states, warm, made, &stop};
  const Options both[2] = {options, options};
  native_roll_out(block, &batch, 0, MANY);
  native_solve_many(block, &batch, both, 0, MANY);
  for (int i = 0; i < MANY; i++) printf(" %.0f", made[i * MADE + REPORTED]);
  printf(" %.12e", made[(MANY - 1) * MADE]);
  free(xs), free(us), free(lambdas), free(made), free(has_states), free(warm);
  free(block);
  return 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("make", [swing, free_time])
def test_it_solves_under_sanitizers_and_without_a_warning(make, tmp_path: Path) -> None:
    ocp = make()
    assert scaled(ocp) is None  # so that the program is that of the solver
    solver = MultipleShooting(N, backend="native")
    tr = Transcription(ocp, N, RK4(), nodes=solver.nodes(ocp, N))
    code = StageCode(tr)
    arrays = _arrays(code)
    lines = [f"static const double {name}[] = {{{_numbers(a)}}};" for name, a in arrays.items()]
    source, program = tmp_path / "strict.c", tmp_path / "strict"
    source.write_text(
        "\n".join([code.code, f"#define INTERVALS {N}", f"#define MANY {MANY}", *lines, _MAIN])
    )
    words = [*Compiler().found, *STRICT, str(source), "-o", str(program), "-lm"]
    end, said = run_limited(words, 120.0, tmp_path)
    assert end == 0, f"{shlex.join(words)}\n{said}"
    end, said = run_limited([str(program)], 60.0, tmp_path)
    assert end == 0, said
    ending, cost, *many, last = said.split()
    assert [ending, *many] == ["0"] * (1 + MANY)
    assert last == cost
    assert float(cost) == pytest.approx(solve(ocp, solver).or_raise().cost, rel=1e-9)


def _arrays(code: StageCode) -> dict[str, np.ndarray]:
    """Return what a caller writes, for a first iterate at the start."""
    tr = code.transcription
    data = RunData.of(tr.ocp)
    library = NativeLibrary.of(code)
    at, bounds = library.arrays, tr.bounds(data)
    FlatRows.of(code).put_bounds(at, bounds)
    x, u = np.tile(tr.ocp.start(), (N + 1, 1)), np.zeros((N, code.nu))
    if tr.ocp.has_free_time:
        x = np.hstack([x, np.full((N + 1, 1), tr.ocp.duration / tr.time_unit)])
    x, u = tr.split(np.clip(tr.join(x, u), bounds["lbx"], bounds["ubx"]))
    given = {"x": x, "u": u, "data": code.data(tr.data_vector(data))}
    return given | {"low": at.low, "up": at.up, "x_given": at.x_given}


def _numbers(array: np.ndarray) -> str:
    words = {np.inf: "INFINITY", -np.inf: "-INFINITY"}
    return ", ".join(words.get(value, repr(float(value))) for value in array.ravel())
