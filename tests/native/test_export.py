"""The exported C against Python: recorded loops are repeated, bad input is refused by a code."""

import re
import shlex
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from models import Disc, DistanceCost, PlanarArm, cart_pole_upright, redundancy_ocp
from ocp import (
    MPC,
    OCP,
    Box,
    Compiler,
    Constraint,
    Model,
    Parameter,
    Plant,
    PlantInput,
    ProblemError,
    Rate,
    Rollout,
    Signal,
    Soft,
    UnsupportedProblem,
)
from ocp.codegen.run_limited import run_limited
from ocp.internal import scaled
from solvers import MultipleShooting, export_c
from tests.native.problems import designed, free_time, swing

STRICT = ("-std=c11", "-O1", "-g", "-Wall", "-Wextra", "-Werror")
SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
NATIVE = MultipleShooting(12, backend="native", judged=False)

X, U, PULL, WIND = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("pull"), ca.SX.sym("wind")


def pushed(**changes) -> OCP:
    """A pendulum in the wind, with a parameter, a signal, and a bound of the input that is met."""
    given = {
        "name": "pushed",
        "model": Model(
            name="pendulum", x=X, u=U, f=ca.vertcat(X[1], U + PULL * ca.sin(X[0]) + WIND)
        ),
        "x0": [0.5, 0.0],
        "horizon": 1.2,
        "running_cost": X[0] ** 2 + 0.1 * X[1] ** 2 + 0.05 * U**2,
        "control_bounds": Box(-1.2, 1.2),
        "state_bounds": Box([-2.0, -1.5], [2.0, 1.5]),
        "parameters": (
            Parameter("pull", PULL, 0.7),
            Signal("wind", WIND, [0.1, -0.2, 0.3], hold="linear"),
        ),
    }
    return OCP(**(given | changes))


def loop_of(ocp: OCP, steps: int, noise: list[float], **options) -> tuple[MPC, Rollout]:
    given = {"solver": NATIVE, "dt": 0.1, "compiled": False, "delay": 0.2} | options
    controller = MPC(ocp=ocp, **given)
    plant = Plant(ocp=ocp, measurement_noise=noise)
    return controller, controller.run(plant, ocp.start(), steps * controller.dt, seed=3)


def run(words: list[str], folder: Path, limit: float = 200.0) -> tuple[int | None, str]:
    return run_limited(words, limit, folder)


def built(folder: Path, sources: list[str], command: list[str], flags: tuple[str, ...]) -> Path:
    program = folder / "program"
    paths = [str(folder / name) for name in sources]
    words = [*command, *flags, f"-I{folder}", *paths, "-lm", "-o", str(program)]
    end, said = run(words, folder)
    assert end == 0, f"{shlex.join(words)}\n{said}"
    return program


def repeated(folder: Path, command: list[str], flags, accepted: float, emulator: str = "") -> str:
    program = built(folder, ["loop.c", "example.c"], command, flags)
    end, said = run([*([emulator] if emulator else []), str(program), repr(accepted)], folder)
    assert end == 0, said
    return said


def needed(name: str) -> str:
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"there is no {name}; on Debian `make system` installs compilers, as root")
    return path


# -- a loop ---------------------------------------------------------------------------------------


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
  double twice[LOOP_NU];
  loop_init(one, sizeof one);
  for (int k = 0; k < RECORDED_STEPS; k++)
    loop_feedback(one, recorded[k][0], recorded[k] + 1, recorded[k] + 1 + LOOP_NX, twice);
  printf("%d", memcmp(u, twice, sizeof u) == 0 && same > 0);
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


# -- problems that are rewritten, other compilers ------------------------------------------------


def in_large_numbers() -> OCP:
    """The pendulum in units in which its numbers are huge and tiny."""
    large, small = 1e4, 1e-3
    ocp = pushed(
        model=Model(
            name="far", x=X, u=U, f=ca.vertcat(X[1], large * U / small + PULL * X[0] + large * WIND)
        ),
        x0=[0.8 * large, 0.0],
        running_cost=(X[0] / large) ** 2 + 0.1 * (X[1] / large) ** 2 + 0.05 * (U / small) ** 2,
        control_bounds=Box(-2.5 * small, 2.5 * small),
        state_bounds=Box([-2.0 * large, -0.9 * large], [2.0 * large, 2.0 * large]),
    )
    assert scaled(ocp) is not None
    return ocp


def changing_slowly() -> OCP:
    """A pendulum whose input has a bounded rate, and whose speed has a soft bound."""
    return pushed(
        name="slow",
        rates=(Rate(U, -3.0, 3.0),),
        last_input=[0.1],
        constraints=(Constraint("speed", X[1], lower=-0.4, soft=Soft(10.0, 1.0)),),
    )


SOLVES = """
#include <stdio.h>
#include "loop.h"
static _Alignas(LOOP_ALIGNMENT) unsigned char block[LOOP_WORKSPACE_BYTES];
static double x0[LOOP_NX], p[LOOP_NP + 1], constants[LOOP_CONSTANTS + 1];
static double t[LOOP_N + 1], x[(LOOP_N + 1) * LOOP_NX], u[LOOP_N * LOOP_NU];
static void say(const double *numbers, int count) {
  for (int i = 0; i < count; i++) printf("%.17g ", numbers[i]);
  printf("\\n");
}
int main(void) {
  loop_report report;
  loop_declared(x0, p);
  loop_init(block, sizeof block);
  if (loop_solve(block, 0.0, x0, p) != LOOP_SOLVED) return 1;
  loop_last_report(block, &report);
  const double cost = report.cost;
  loop_plan(block, t, x, u);
  loop_constants(block, constants);
  if (loop_solve_warm(block, 0.0, x0, p) != LOOP_SOLVED) return 2;
  loop_last_report(block, &report);
  const double costs[] = {cost, report.cost};
  say(costs, 2);
  say(t, LOOP_N + 1);
  say(x, (LOOP_N + 1) * LOOP_NX);
  say(u, LOOP_N * LOOP_NU);
  say(constants, LOOP_CONSTANTS);
  return 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("make", [in_large_numbers, swing, changing_slowly, designed, free_time])
def test_a_problem_that_is_rewritten_is_asked_in_its_own_terms(make, tmp_path: Path) -> None:
    program = replace(NATIVE, tolerance=1e-11).build(make())
    export_c(program, tmp_path, name="loop")
    flags = ("-std=c11", "-O0", "-Wall", "-Wextra", "-Werror", "-Wno-psabi")
    words = [*Compiler().found, *flags, "-c", str(tmp_path / "loop.c")]
    end, said = run([*words, "-o", str(tmp_path / "loop.o")], tmp_path)
    assert end == 0, said
    example = built(tmp_path, ["example.c", "loop.o"], Compiler().found, flags)
    end, said = run([str(example), "1e-7"], tmp_path)
    assert end == 0, said
    (tmp_path / "main.c").write_text(SOLVES)
    main = built(tmp_path, ["main.c", "loop.o"], Compiler().found, flags)
    end, said = run([str(main)], tmp_path)
    assert end == 0, said
    costs, t, x, u, constants = (np.fromstring(line, sep=" ") for line in said.split("\n")[:5])
    known = program.run().or_raise()
    np.testing.assert_allclose(costs, known.cost, rtol=1e-7)
    np.testing.assert_allclose(t, known.t, rtol=1e-7)
    for found, own in ((x, known.x), (u, known.u[: len(known.t) - 1])):
        size = np.abs(own).max(axis=0)
        np.testing.assert_allclose(found.reshape(own.shape) / size, own / size, atol=1e-6)
    values = [np.ravel(value) for value in known.unknowns.values()]
    np.testing.assert_allclose(constants, np.concatenate([[], *values]), rtol=1e-7)


@pytest.mark.slow
def test_a_loop_with_rates_starts_from_what_was_sent(tmp_path: Path) -> None:
    # Multipliers that nearly vanish let an optimum move by the root of the tolerance.
    solver = replace(NATIVE, tolerance=1e-12)
    controller, rollout = loop_of(changing_slowly(), 30, [1e-2, 1e-2], solver=solver)
    export_c(controller, tmp_path, name="loop", recorded=rollout)
    flags = ("-std=c11", "-O0", "-Wall", "-Wextra", "-Werror", "-Wno-psabi")
    repeated(tmp_path, Compiler().found, flags, 1e-7)


@pytest.fixture(scope="module")
def cart(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cart-pole near the end of its track, with noise and a delay, 1000 steps."""
    controller, rollout = loop_of(
        cart_pole_upright(track=0.6),
        1000,
        [1e-3, 1e-3, 1e-2, 1e-2],
        solver=MultipleShooting(40, backend="native"),
        dt=0.02,
        delay=0.04,
    )
    folder = tmp_path_factory.mktemp("cart")
    return export_c(controller, folder, name="loop", recorded=rollout)


@pytest.mark.slow
def test_a_thousand_steps_under_sanitizers(cart: Path) -> None:
    flags = (*STRICT, "-Wno-psabi", *SANITIZED)
    assert "1000 steps" in repeated(cart, Compiler().found, flags, 1e-12)


@pytest.mark.slow
def test_a_thousand_steps_by_clang(cart: Path) -> None:
    trapping = ("-fsanitize=undefined", "-fsanitize-trap=undefined")
    assert "1000 steps" in repeated(cart, [needed("clang")], (*STRICT, *trapping), 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("compiler", "emulator"),
    [("aarch64-linux-gnu-gcc", "qemu-aarch64"), ("arm-linux-gnueabihf-gcc -DONE_LANE", "qemu-arm")],
)
def test_a_thousand_steps_on_arm(cart: Path, compiler: str, emulator: str) -> None:
    name, *options = compiler.split()
    command, emulator = [needed(name), *options], needed(emulator)
    flags = ("-std=c11", "-O1", "-Wall", "-Wextra", "-Werror", "-Wno-psabi", "-static")
    assert "1000 steps" in repeated(cart, command, flags, 1e-9, emulator)


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


@pytest.mark.slow
def test_a_loop_may_begin_at_a_known_solution(tmp_path: Path) -> None:
    known = NATIVE.build(pushed()).run().or_raise()
    controller, rollout = loop_of(pushed(), 10, [1e-2, 1e-2], guess=known, delay=0.0)
    export_c(controller, tmp_path, name="loop", recorded=rollout)
    flags = ("-std=c11", "-O0", "-Wall", "-Wextra", "-Werror", "-Wno-psabi")
    repeated(tmp_path, Compiler().found, flags, 1e-12)


def redundant() -> OCP:
    """An arm of three links whose end follows a path past a disc."""
    robot, start, t = PlanarArm((1.0, 1.0, 1.0)), (0.4, 0.9, 0.7), ca.SX.sym("t")
    offset, first = ca.SX.sym("offset"), ca.DM(PlanarArm((1.0, 1.0, 1.0)).end_effector(start))
    return redundancy_ocp(
        robot,
        lambda t: first + ca.vertcat(0.3 * ca.sin(2.0 * t) + offset, 0.0),
        theta0=start,
        horizon=0.5,
        obstacles=(Disc((1.9, 0.4), 0.1),),
        distance_cost=DistanceCost(10.0, 0.6, "sum"),
        correction=5.0,
        parameters=(Parameter("offset", offset, 0.0),),
        t=t,
        name="arm",
    )


@pytest.mark.slow
def test_an_arm_is_sent_joint_velocities(tmp_path: Path) -> None:
    ocp, rate = redundant(), ca.SX.sym("rate", 3)
    sent = PlantInput("rate", Box(-2.0, 2.0))
    controller = MPC(
        ocp=ocp, solver=NATIVE, dt=0.05, delay=0.1, applied=sent, compiled=False, backup="hold"
    )
    angles = ca.SX.sym("theta", 3)
    truth = Model(name="arm", x=angles, u=rate, f=1.01 * rate)
    judge = OCP(name="arm", model=truth, x0=ocp.start(), horizon=1.0, running_cost=ca.sumsqr(rate))
    plant = Plant(ocp=judge, measurement_noise=1e-3)
    rollout = controller.run(plant, ocp.start(), 50 * 0.05)
    assert np.abs(rollout.inputs).max() > 0.2
    export_c(controller, tmp_path, name="loop", recorded=rollout)
    flags = ("-std=c11", "-O0", "-Wall", "-Wextra", "-Werror", "-Wno-psabi", *SANITIZED)
    said = repeated(tmp_path, Compiler().found, flags, 1e-12)
    assert "50 steps" in said
    assert "u[2]  rate of" in (tmp_path / "README.md").read_text()
