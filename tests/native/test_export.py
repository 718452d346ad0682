"""The exported C: a recorded loop is repeated, bad input is refused by a code or by name."""

import re
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from ocp import MPC, Compiler, ProblemError, Rollout, UnsupportedProblem
from solvers import MultipleShooting, export_c
from tests.native.exporting import (
    NATIVE,
    SANITIZED,
    STRICT,
    built,
    loop_of,
    needed,
    pushed,
    run,
)
from tests.native.pendulum import U, X


@dataclass
class Exported:
    folder: Path
    rollout: Rollout


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    """A loop whose parameters change at every step, 50 of them."""
    controller, rollout = loop_of(
        pushed(),
        50,
        [1e-2, 1e-2],
        parameters=lambda t: {
            "pull": 0.7 + 0.1 * np.sin(t),
            "wind": 0.2 * np.cos(t + np.arange(3)),
        },
    )
    folder = export_c(controller, tmp_path_factory.mktemp("quick"), name="loop", recorded=rollout)
    command = Compiler().found
    flags = (*STRICT, "-O0", "-Wno-psabi", *SANITIZED, "-c")
    words = [*command, *flags, str(folder / "loop.c"), "-o", str(folder / "loop.o")]
    end, said = run(words, folder)
    assert end == 0, f"{shlex.join(words)}\n{said}"
    return Exported(folder, rollout)


def linked(exported: Exported, main: str) -> str:
    """Compile a main beside the loop, run it, return what it prints."""
    (exported.folder / "main.c").write_text(main)
    flags = (*STRICT, *SANITIZED)
    program = built(exported.folder, ["main.c", "loop.o"], Compiler().found, flags)
    end, said = run([str(program)], exported.folder)
    assert end == 0, said
    return said


def test_a_recorded_loop_is_repeated(quick: Exported) -> None:
    assert np.abs(quick.rollout.inputs).max() == pytest.approx(1.2)  # the bound is met
    program = built(quick.folder, ["example.c", "loop.o"], Compiler().found, (*STRICT, *SANITIZED))
    end, said = run([str(program), "1e-12"], quick.folder)
    assert end == 0, said
    assert "50 steps" in said


CODES = """
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "loop.h"
static _Alignas(LOOP_ALIGNMENT) unsigned char block[LOOP_WORKSPACE_BYTES + 64];
static double x[LOOP_NX], p[LOOP_NP], u[LOOP_NU];
static void say(const char *what, loop_status status) { printf("%s %d\\n", what, (int)status); }
int main(void) {
  const size_t bytes = sizeof block;
  loop_declared(x, p);
  say("null", loop_init(NULL, bytes));
  say("misaligned", loop_init(block + 8, bytes - 8));
  say("small", loop_init(block, loop_workspace_bytes() - 1));
  say("foreign", loop_feedback(block, 0.0, x, p, u));
  printf("macro %d\\n", loop_workspace_bytes() <= LOOP_WORKSPACE_BYTES);
  printf("close %d\\n", loop_workspace_bytes() + 1024 >= LOOP_WORKSPACE_BYTES);
  say("init", loop_init(block, LOOP_WORKSPACE_BYTES));
  say("no plan", loop_follow(block, 0.0, u));
  say("no state", loop_feedback(block, 0.0, NULL, p, u));
  say("no parameters", loop_feedback(block, 0.0, x, NULL, u));
  say("no input", loop_feedback(block, 0.0, x, p, NULL));
  x[1] = NAN;
  say("NaN state", loop_feedback(block, 0.0, x, p, u));
  x[1] = 0.0;
  p[2] = INFINITY;
  say("infinite parameter", loop_solve(block, 0.0, x, p));
  p[2] = 0.0;
  say("NaN time", loop_solve_warm(block, NAN, x, p));
  const double acting = NAN;
  say("NaN input", loop_reset(block, &acting));
  say("NaN sent", loop_sent(block, &acting));
  say("feedback", loop_feedback(block, 0.0, x, p, u));
  double before[LOOP_N + 1], plan[LOOP_N];
  loop_plan(block, before, NULL, plan);
  x[1] = 40.0; /* no force holds that within its bounds */
  say("shifted", loop_feedback(block, 0.1, x, p, u));
  printf("input %d\\n", u[0] == plan[1]);
  loop_report report;
  loop_last_report(block, &report);
  printf("reason %d\\n", report.status != LOOP_SOLVED && report.iterations > 0);
  say("follow", loop_follow(block, 0.2, u));
  printf("input %d\\n", u[0] == plan[2]);
  say("after its end", loop_follow(block, 9.0, u));
  x[1] = 0.0;
  say("again", loop_feedback(block, 0.3, x, p, u));
  block[0] ^= 1; /* as a library of another version would have it */
  say("other version", loop_feedback(block, 0.4, x, p, u));
  return 0;
}
"""


def test_bad_input_is_refused_by_a_code(quick: Exported) -> None:
    said = [line.rsplit(" ", 1) for line in linked(quick, CODES).splitlines()]
    assert [(what, int(code)) for what, code in said] == [
        ("null", 16),
        ("misaligned", 18),
        ("small", 17),
        ("foreign", 19),
        ("macro", 1),
        ("close", 1),
        ("init", 0),
        ("no plan", 6),
        ("no state", 16),
        ("no parameters", 16),
        ("no input", 16),
        ("NaN state", 21),
        ("infinite parameter", 22),
        ("NaN time", 20),
        ("NaN input", 23),
        ("NaN sent", 23),
        ("feedback", 0),
        ("shifted", 5),
        ("input", 1),
        ("reason", 1),
        ("follow", 0),
        ("input", 1),
        ("after its end", 6),
        ("again", 0),
        ("other version", 19),
    ]


BESIDE = """
#include <stdio.h>
#include <string.h>
#include "loop.h"
#include "loop_recorded.h"
static _Alignas(LOOP_ALIGNMENT) unsigned char one[LOOP_WORKSPACE_BYTES], two[LOOP_WORKSPACE_BYTES];
int main(void) {
  double x[LOOP_NX], p[LOOP_NP], u[LOOP_NU], v[LOOP_NU];
  loop_declared(x, p);
  loop_init(one, sizeof one);
  loop_init(two, sizeof two);
  int same = 0;
  for (int k = 0; k < RECORDED_STEPS; k++) {
    const double *row = recorded[k], *parameters = row + 1 + LOOP_NX;
    loop_feedback(one, row[0], row + 1, parameters, u);
    loop_feedback(two, 0.1 * k, x, p, v); /* another loop in between */
    same += u[0] == row[1 + LOOP_NX + LOOP_NP] || k > 0;
  }
  double twice[LOOP_NU], once[LOOP_NU];
  loop_init(one, sizeof one);
  for (int k = 0; k < RECORDED_STEPS; k++)
    loop_feedback(one, recorded[k][0], recorded[k] + 1, recorded[k] + 1 + LOOP_NX, twice);
  const int repeats = memcmp(u, twice, sizeof u) == 0 && same > 0;
  /* Two inputs are on their way: both workspaces are told the same ones. */
  loop_reset(one, u);
  loop_init(two, sizeof two);
  for (int k = 0; k < 2; k++) loop_sent(two, u);
  loop_feedback(one, 0.0, x, p, v);
  loop_feedback(two, 0.0, x, p, once);
  printf("%d", repeats && memcmp(v, once, sizeof v) == 0);
  return 0;
}
"""


def test_two_workspaces_know_nothing_of_each_other(quick: Exported) -> None:
    assert linked(quick, BESIDE) == "1"


def test_the_folder_says_what_every_number_is(quick: Exported) -> None:
    names = {path.name for path in quick.folder.iterdir()}
    written = {"loop.c", "loop.h", "loop_lanes.h", "loop_recorded.h", "example.c"}
    assert written | {"CMakeLists.txt", "README.md"} <= names
    said = (quick.folder / "README.md").read_text()
    assert "x[0]  " in said
    assert "parameters[1] to [3]  wind: 3 samples of 1" in said
    assert "export" not in (quick.folder / "loop.h").read_text().replace("exporter", "")


# -- refusals -------------------------------------------------------------------------------------


def test_what_has_no_c_is_refused_by_name(tmp_path: Path) -> None:
    ocp = pushed()
    with pytest.raises(UnsupportedProblem, match="MultipleShooting\\(backend='native'\\)"):
        export_c(MultipleShooting(5).build(ocp), tmp_path, name="p")
    kinked = pushed(running_cost=X[0] ** 2 + 0.1 * ca.fabs(U))
    with pytest.raises(UnsupportedProblem, match="cost with kinks"):
        export_c(NATIVE.build(kinked), tmp_path, name="p")
    hasty = MPC(ocp=ocp, solver=NATIVE, dt=0.1, real_time=True, compiled=False)
    with pytest.raises(UnsupportedProblem, match="real_time"):
        export_c(hasty, tmp_path, name="p")
    other = MPC(ocp=ocp, solver=MultipleShooting(5), dt=0.1, compiled=False)
    with pytest.raises(UnsupportedProblem, match="has no C"):
        export_c(other, tmp_path, name="p")
    assert not list(tmp_path.iterdir())


def test_arguments_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    program = NATIVE.build(pushed())
    for name in ("", "Loop", "1st", "double", "a b", None):
        with pytest.raises(ProblemError, match="must be a name in C"):
            export_c(program, tmp_path, name=name)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ProblemError, match="no Rollout"):
        export_c(program, tmp_path, name="p", recorded=3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ProblemError, match="what to export"):
        export_c(pushed(), tmp_path, name="p")  # pyright: ignore[reportArgumentType]
    (tmp_path / "file").write_text("")
    with pytest.raises(ProblemError, match="cannot be written"):
        export_c(program, tmp_path / "file", name="p")
    controller, rollout = loop_of(
        pushed(), 3, [0.0, 0.0], parameters=lambda t: {"wind": [0.1, 0.2]}
    )
    with pytest.raises(UnsupportedProblem, match="'wind' has 2 samples, in C the 3"):
        export_c(controller, tmp_path, name="p", recorded=rollout)


@pytest.mark.slow
def test_it_needs_libm_and_memory_functions_alone(quick: Exported, tmp_path: Path) -> None:
    shutil.copytree(quick.folder, tmp_path, dirs_exist_ok=True)
    words = [*Compiler().found, "-std=c11", "-O1", "-Wno-psabi", "-fno-stack-protector", "-c"]
    words.append("-fstack-usage")
    end, said = run([*words, str(tmp_path / "loop.c"), "-o", str(tmp_path / "bare.o")], tmp_path)
    assert end == 0, said
    end, said = run([needed("nm"), str(tmp_path / "bare.o")], tmp_path)
    assert end == 0, said
    lines = [line.split() for line in said.splitlines()]
    wanted = {words[-1] for words in lines if words[-2] == "U"} - {"_GLOBAL_OFFSET_TABLE_"}
    # What the problem calls, and what the solver itself does.
    mathematics = {"sin", "cos", "log", "pow", "sqrt", "fmin", "fmax"}
    assert wanted <= mathematics | {"memcpy", "memmove", "memset"}
    own = {words[-1] for words in lines if words[-2] in "TDBC"}
    assert all(name.startswith("loop_") for name in own)
    changing = {words[-1] for words in lines if words[-2] in "dDbBC"}
    assert not changing
    frames = [line.split("\t") for line in (tmp_path / "bare.su").read_text().splitlines()]
    assert all(kind in ("static", "dynamic,bounded") for *_, kind in frames)
    told = re.search("stack takes about ([0-9]+) kB", (tmp_path / "README.md").read_text())
    assert told
    assert max(int(size) for _, size, _ in frames) <= 1024 * int(told[1])


@pytest.mark.slow
def test_cmake_builds_it(quick: Exported, tmp_path: Path) -> None:
    cmake, folder = needed("cmake"), str(tmp_path / "build")
    shutil.copytree(quick.folder, tmp_path / "loop")
    options = ["-DCMAKE_BUILD_TYPE=Debug"]  # which takes a third of the time
    for words in (
        ["-S", str(tmp_path / "loop"), "-B", folder, *options],
        ["--build", folder, "--target", "loop_example"],
    ):
        end, said = run([cmake, *words], tmp_path)
        assert end == 0, said
    end, said = run([str(tmp_path / "build" / "loop_example")], tmp_path)
    assert end == 0, said
