"""The exported C of problems that are rewritten, by other compilers, and on other machines."""

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from models import Disc, DistanceCost, PlanarArm, cart_pole_upright, redundancy_ocp
from ocp import MPC, OCP, Box, Compiler, Constraint, Model, Parameter, Plant, PlantInput, Rate, Soft
from solvers import MultipleShooting, export_c
from tests.native.exporting import (
    NATIVE,
    SANITIZED,
    STRICT,
    built,
    loop_of,
    needed,
    pushed,
    repeated,
    run,
)
from tests.native.pendulum import U, X, in_large_numbers
from tests.native.problems import designed, free_time, swing


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
