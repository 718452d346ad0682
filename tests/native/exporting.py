"""Loops to export, and what compiles and runs the C of them."""

import shlex
import shutil
from pathlib import Path

import pytest

from ocp import MPC, OCP, Box, Parameter, Plant, Rollout, Signal
from ocp.codegen.run_limited import run_limited
from solvers import MultipleShooting
from tests.native import pendulum
from tests.native.pendulum import PULL, WIND

STRICT = ("-std=c11", "-O1", "-g", "-Wall", "-Wextra", "-Werror")
SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
NATIVE = MultipleShooting(12, backend="native", judged=False)


def pushed(**changes) -> OCP:
    """A pendulum in the wind, with a parameter, a signal, and a bound of the input that is met."""
    given = {
        "x0": [0.5, 0.0],
        "horizon": 1.2,
        "control_bounds": Box(-1.2, 1.2),
        "state_bounds": Box([-2.0, -1.5], [2.0, 1.5]),
        "parameters": (
            Parameter("pull", PULL, 0.7),
            Signal("wind", WIND, [0.1, -0.2, 0.3], hold="linear"),
        ),
    }
    return pendulum.pushed(**(given | changes))


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


def repeated(
    folder: Path, command: list[str], flags: tuple[str, ...], accepted: float, emulator: str = ""
) -> str:
    program = built(folder, ["loop.c", "example.c"], command, flags)
    end, said = run([*([emulator] if emulator else []), str(program), repr(accepted)], folder)
    assert end == 0, said
    return said


def needed(name: str) -> str:
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"there is no {name}; on Debian `make system` installs compilers, as root")
    return path
