"""A process is killed at any instant: what it had said to be written is there."""

import os
import signal
import time
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from benchmarks.sweep.rows_file import prepare, read_rows
from ocp import Compiler, Solution, records
from ocp.codegen import compile as codegen
from ocp.codegen.compile import compiled
from ocp.codegen.kept_library import kept_library
from ocp.files.draft import remove_abandoned
from tests.files import victims
from tests.files.examples import function, problem, row, solution

pytestmark = pytest.mark.skipif(os.name != "posix", reason="there is no SIGKILL")
needs_compiler = pytest.mark.skipif(not Compiler().found, reason="no compiler on this machine")
KILLS = pytest.mark.parametrize("number", [4, pytest.param(50, marks=pytest.mark.slow)])
LONGEST = 0.06  # after what it says for the first time [s]

# Its processes begin with everything imported.
CONTEXT = get_context("forkserver")
CONTEXT.set_forkserver_preload(["tests.files.victims"])


def killed(does: Callable, folder: Path, after: float) -> int:
    """Let a process work, kill it, and return the last number that it had sent."""
    folder.mkdir()
    ours, theirs = CONTEXT.Pipe(duplex=False)
    process = CONTEXT.Process(target=does, args=(theirs, folder), daemon=True)
    process.start()
    theirs.close()
    last = ours.recv()
    time.sleep(after)
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    process.join()
    assert process.exitcode == -signal.SIGKILL
    try:
        while True:
            last = ours.recv()
    except (EOFError, OSError):  # the last number may be torn, too
        return last


def instants(number: int) -> list[float]:
    return np.random.default_rng(number).uniform(0.0, LONGEST, size=number).tolist()


@KILLS
def test_a_saved_solution_is_whole_and_the_newest(tmp_path, number):
    for k, after in enumerate(instants(number)):
        folder = tmp_path / str(k)
        last = killed(victims.save, folder, after)
        assert Solution.load(folder / "kept.npz", problem()).cost in (last, last + 1)
        solution().save(folder / "kept.npz")
        assert [file.name for file in folder.iterdir()] == ["kept.npz"], "no draft stays"


@KILLS
def test_every_step_that_was_recorded_is_read(tmp_path, number):
    for k, after in enumerate(instants(number)):
        last = killed(victims.record, tmp_path / str(k), after)
        found = [int(step.measured[0]) for step in records(tmp_path / str(k) / "flight")]
        assert found in (list(range(last + 1)), list(range(last + 2)))


@KILLS
def test_every_row_that_was_appended_is_read(tmp_path, number):
    for k, after in enumerate(instants(number)):
        file = tmp_path / str(k) / "results.jsonl"
        last = killed(victims.append, file.parent, after)
        prepare(file)
        row(-1).append_to(file)
        found = [int(one.case.removeprefix("case ")) for one in read_rows(file)]
        assert found in ([*range(last + 1), -1], [*range(last + 2), -1])


@needs_compiler
@KILLS
def test_a_cache_has_whole_libraries_and_no_litter(tmp_path, number, monkeypatch):
    compiler = Compiler(cache=tmp_path / "0", flags=victims.FLAGS)
    for k, after in enumerate(instants(number)):
        folder = tmp_path / str(k)
        last = killed(victims.build, folder, 5.0 * after)
        libraries = list(folder.glob("[0-9a-f]*-*"))
        assert len(libraries) in (last + 1, last + 2)
        for library in libraries:
            key = library.name.partition("-")[0]
            assert kept_library(folder, key, library.suffix) == library
        with monkeypatch.context() as patch:
            patch.setattr(codegen, "_build", None)  # it is loaded
            compiler = Compiler(cache=folder, flags=victims.FLAGS)
            assert compiled(function(last), compiler=compiler).is_a("External")
        compiled(function(-1), compiler=compiler)
        while list(folder.glob(".*")):  # the compiler has outlived its process, and still writes
            time.sleep(0.05)
            remove_abandoned(folder)
