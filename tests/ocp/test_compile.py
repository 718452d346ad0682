import gc
import os
import shutil
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ocp import RK4, Compiler, InterpretedWarning, ProblemError
from ocp.codegen.buffered_function import BufferedFunction
from ocp.codegen.compile import c_code, compiled
from ocp.integration.one_step import Stage
from tests.mpc.problems import cart

# Machine code may contract a multiplication and an addition to one rounding.
SAME = 1e-13
HAS_COMPILER = bool(Compiler().found)
needs_compiler = pytest.mark.skipif(not HAS_COMPILER, reason="no compiler on this machine")


def pendulum() -> ca.Function:
    """Name the same inputs as a stage: x (2,), u, t."""
    x, u, t = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("t")
    after = ca.vertcat(x[0] + 0.1 * x[1], x[1] - 0.1 * ca.sin(x[0]) * u + ca.exp(-t * x[0]))
    cost = ca.cos(x[0] * u) + x[1] ** 2
    return ca.Function("step", [x, u, t], [after, cost], ["x", "u", "t"], ["after", "cost"])


def declared(function: ca.Function, along: set[str]) -> ca.Function:
    """Return a function whose other inputs count as constants."""
    inputs = function.sx_in()
    outputs = list(function.call(inputs))
    options = {"is_diff_in": [name in along for name in function.name_in()]}
    names = function.name_in(), function.name_out()
    return ca.Function(function.name(), inputs, outputs, *names, options)


def values(function: ca.Function, seed: int) -> list[ca.DM]:
    rng = np.random.default_rng(seed)
    patterns = (function.sparsity_in(i) for i in range(function.n_in()))
    return [ca.DM(p, rng.normal(size=p.nnz())) for p in patterns]


def assert_same(one: ca.Function, other: ca.Function, seed: int) -> None:
    inputs = values(one, seed)
    for a, b in zip(one.call(inputs), other.call(inputs), strict=True):
        np.testing.assert_allclose(np.array(a), np.array(b), rtol=SAME, atol=SAME)


@needs_compiler
@pytest.mark.parametrize("seed", range(3))
def test_values_and_derivatives_are_those_of_the_interpreted_function(tmp_path, seed):
    function = pendulum()
    fast = compiled(function, along=("x", "u"), compiler=Compiler(cache=tmp_path))
    slow = declared(function, {"x", "u"})
    assert fast.is_a("External")
    assert_same(slow, fast, seed)
    assert_same(slow.jacobian(), fast.jacobian(), seed)
    assert_same(slow.reverse(1), fast.reverse(1), seed)
    assert_same(slow.forward(2), fast.forward(2), seed)
    assert_same(slow.reverse(1).jacobian(), fast.reverse(1).jacobian(), seed)


@needs_compiler
def test_an_arm_of_stages_is_the_same_in_a_row_and_side_by_side():
    step = Stage.of(cart(), RK4(), held=True).step
    fast = compiled(step)
    assert_same(step.mapaccum(7), fast.mapaccum(7), 0)
    assert_same(step.map(7), fast.map(7), 0)


@needs_compiler
def test_gradient_and_hessian_of_a_sum_over_stages_are_exact(tmp_path):
    function = pendulum()
    fast = compiled(function, along=("x", "u"), compiler=Compiler(cache=tmp_path))
    w, t = ca.MX.sym("w", 3, 5), ca.DM.ones(1, 5)

    def second(step: ca.Function) -> ca.Function:
        after, cost = step.map(5)(w[:2, :], w[2, :], t)
        total = ca.sum2(cost) + ca.sumsqr(after)
        hessian, gradient = ca.hessian(total, ca.vec(w))
        return ca.Function("second", [w], [gradient, hessian])

    assert_same(second(function), second(fast), 1)


@needs_compiler
def test_without_derivatives_there_are_none(tmp_path):
    fast = compiled(pendulum(), compiler=Compiler(cache=tmp_path))
    with pytest.raises(RuntimeError):
        fast.jacobian()


@needs_compiler
def test_what_was_built_once_is_loaded(tmp_path, monkeypatch):
    compiler = Compiler(cache=tmp_path)
    compiled(pendulum(), compiler=compiler)
    libraries = list(tmp_path.iterdir())
    assert len(libraries) == 1, "no source and no temporary file stays"

    def forbidden(*_args: object) -> None:
        raise AssertionError("it is built again")

    monkeypatch.setattr("ocp.codegen.compile._build", forbidden)
    again = compiled(pendulum(), compiler=compiler)
    assert again.is_a("External")
    assert_same(pendulum(), again, 0)


@needs_compiler
def test_other_flags_and_other_code_make_other_libraries(tmp_path):
    compiled(pendulum(), compiler=Compiler(cache=tmp_path))
    compiled(pendulum(), compiler=Compiler(cache=tmp_path, flags=("-O1",)))
    compiled(pendulum(), along=("x",), compiler=Compiler(cache=tmp_path))
    assert len(list(tmp_path.iterdir())) == 3


@needs_compiler
def test_long_code_is_not_optimised(tmp_path):
    short, long = Compiler(cache=tmp_path), Compiler(cache=tmp_path, optimised=100)
    assert "-O0" not in short.words("int x;")
    assert long.words("int x;" * 100)[-1] == "-O0"
    assert_same(pendulum(), compiled(pendulum(), compiler=long), 0)


BUILD = """
import sys
from pathlib import Path
from ocp import Compiler
from ocp.internal import compiled
from tests.ocp.test_compile import pendulum
fast = compiled(pendulum(), along=("x", "u"), compiler=Compiler(cache=Path(sys.argv[1])))
assert fast.is_a("External")
print(float(fast([1.0, 2.0], 3.0, 0.5)[1]))
"""


@needs_compiler
@pytest.mark.slow
def test_processes_may_build_at_once(tmp_path):
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    words = [sys.executable, "-c", BUILD, str(tmp_path / "shared")]
    running = [
        subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment, cwd=root)
        for _ in range(2)
    ]
    answers = [process.communicate(timeout=100)[0] for process in running]
    assert [process.returncode for process in running] == [0, 0]
    assert answers[0] == answers[1]
    assert len(list((tmp_path / "shared").iterdir())) == 1


def test_without_a_compiler_it_runs_interpreted(tmp_path):
    with pytest.warns(InterpretedWarning, match="no compiler 'no-such-compiler'"):
        same = compiled(
            pendulum(), along=("x",), compiler=Compiler("no-such-compiler", cache=tmp_path)
        )
    assert same.is_a("SXFunction")
    assert_same(declared(pendulum(), {"x"}).jacobian(), same.jacobian(), 0)


def test_a_compiler_that_is_not_there_is_named_from_the_environment(monkeypatch):
    monkeypatch.setenv("CC", "absent-cc -m64")
    with pytest.warns(InterpretedWarning, match="no compiler 'absent-cc -m64'"):
        compiled(pendulum())


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script stands in for the compiler")
@pytest.mark.parametrize("says", ["out of cheese", ""])
def test_a_failing_compiler_is_quoted(tmp_path, says):
    script = tmp_path / "cc"
    script.write_text(f"#!/bin/sh\necho '{says}' >&2\nexit 1\n")
    script.chmod(0o755)
    cache = tmp_path / "cache"
    with pytest.warns(InterpretedWarning, match=says or "failed: without a word"):
        same = compiled(pendulum(), compiler=Compiler(str(script), cache=cache))
    assert_same(pendulum(), same, 0)
    assert not list(cache.iterdir()), "nothing half done stays"


@needs_compiler
def test_a_cache_that_cannot_be_written_is_named(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("a file where a folder is needed")
    with pytest.warns(InterpretedWarning, match="cannot be written"):
        same = compiled(pendulum(), compiler=Compiler(cache=blocked / "cache"))
    assert_same(pendulum(), same, 0)


@needs_compiler
def test_a_library_that_is_none_is_named(tmp_path):
    script = compiler_that(tmp_path, 'while [ "$1" != "-o" ]; do shift; done; echo none > "$2"')
    with pytest.warns(InterpretedWarning, match="cannot be loaded"):
        same = compiled(pendulum(), compiler=Compiler(script, cache=tmp_path / "cache"))
    assert_same(pendulum(), same, 0)


@needs_compiler
@pytest.mark.parametrize("damage", ["text", "half", "empty", "other", "link", "writable", "folder"])
def test_a_library_that_is_not_what_was_built_is_built_again(tmp_path, damage):
    compiler = Compiler(cache=tmp_path / "cache", flags=("-O0",))
    compiled(pendulum(), along=("x",), compiler=compiler)
    (other,) = compiler.folder.iterdir()
    compiled(pendulum(), compiler=compiler)
    (library,) = set(compiler.folder.iterdir()) - {other}
    whole = library.read_bytes()
    moved = tmp_path / "moved"
    shutil.move(library, moved)
    if damage == "link":
        library.symlink_to(moved)
    elif damage == "folder":
        library.mkdir()
    else:
        swapped = {"text": b"none", "half": whole[:5000], "empty": b"", "other": other.read_bytes()}
        library.write_bytes(swapped.get(damage, whole))
        library.chmod(0o722 if damage == "writable" else 0o700)
    if damage == "folder":  # which nobody has put there by accident
        with pytest.warns(InterpretedWarning, match="cannot be written"):
            compiled(pendulum(), compiler=compiler)
        return
    again = compiled(pendulum(), compiler=compiler)
    assert again.is_a("External")
    assert_same(pendulum(), again, 0)
    assert library.read_bytes() == whole
    assert library.stat().st_mode & 0o777 == 0o700
    assert not library.is_symlink()


@needs_compiler
def test_a_folder_that_everybody_may_change_is_no_cache(tmp_path):
    tmp_path.chmod(0o777)
    with pytest.warns(InterpretedWarning, match="everybody may change the files in"):
        same = compiled(pendulum(), compiler=Compiler(cache=tmp_path))
    assert_same(pendulum(), same, 0)


def compiler_that(folder: Path, does: str) -> str:
    """A script that knows its version."""
    script = folder / "cc"
    script.write_text(f'#!/bin/sh\n[ "$1" = --version ] && exit 0\n{does}\n')
    script.chmod(0o755)
    return str(script)


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script stands in for the compiler")
@pytest.mark.parametrize(
    ("does", "said"),
    [
        ("sleep 1000 & sleep 1000", r"did not end within 0\.5 s"),
        ("kill -SEGV $$", "it was ended by signal 11"),
        (r"printf '\377\376 broken\n' >&2; exit 1", "failed: .. broken"),
        (r"printf '\377\376'; exit 0", "failed: .."),
        ("cat; exit 4", "without a word"),
    ],
)
def test_a_compiler_that_misbehaves_is_ended_and_quoted(tmp_path, does, said):
    cache, limit = tmp_path / "cache", 0.5 if "sleep" in does else 300.0
    compiler = Compiler(compiler_that(tmp_path, does), cache=cache, time_limit=limit)
    with pytest.warns(InterpretedWarning, match=said):
        same = compiled(pendulum(), compiler=compiler)
    assert_same(pendulum(), same, 0)
    assert not list(cache.iterdir()), "nothing half done stays"


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script stands in for the compiler")
def test_a_compiler_that_does_not_say_its_version_is_not_waited_for(tmp_path):
    script = tmp_path / "cc"
    script.write_text("#!/bin/sh\nsleep 1000\n")
    script.chmod(0o755)
    compiler = Compiler(str(script), cache=tmp_path, time_limit=0.2)
    with pytest.warns(InterpretedWarning, match="--version does not answer"):
        compiled(pendulum(), compiler=compiler)


@pytest.mark.parametrize("command", ['gcc "', "gcc 'x", "\\", '""'])
def test_a_command_that_is_none_is_named(monkeypatch, command):
    monkeypatch.setenv("CC", command)
    assert Compiler().found == []
    with pytest.warns(InterpretedWarning, match="compiler") as warned:
        compiled(pendulum())
    assert command in str(warned[0].message)


@needs_compiler
def test_a_user_without_a_home_is_told_so(monkeypatch):
    def homeless(*_args: object) -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    with pytest.warns(InterpretedWarning, match="there is no home folder: set XDG_CACHE_HOME"):
        same = compiled(pendulum())
    assert_same(pendulum(), same, 0)


def test_one_warning_for_one_reason(tmp_path, recwarn):
    compiler = Compiler("this-one-is-missing", cache=tmp_path)
    with pytest.warns(InterpretedWarning):
        compiled(pendulum(), compiler=compiler)
    compiled(pendulum(), compiler=compiler)
    assert not recwarn.list


def test_derivatives_along_something_else_are_refused():
    with pytest.raises(ProblemError, match="step has no input 'v'"):
        compiled(pendulum(), along=("x", "v"))


# -- Buffered ---------------------------------------------------------------------------------


@given(n=st.integers(1, 4), columns=st.integers(1, 5), seed=st.integers(0, 9))
def test_a_buffered_function_is_the_function(n, columns, seed):
    x, p = ca.SX.sym("x", n), ca.SX.sym("p", 0)
    sparse = ca.diag(x)  # the off-diagonal entries are structural zeros
    function = ca.Function("f", [x, p], [sparse, ca.sumsqr(x), p]).map(columns)
    given = np.random.default_rng(seed).normal(size=(n, columns))
    empty = np.empty((0, columns))
    for one, other in zip(
        BufferedFunction(function)(given, empty), function(given, empty), strict=True
    ):
        np.testing.assert_array_equal(one, np.array(other).reshape(one.shape))


def test_a_buffered_function_is_evaluated_in_its_own_memory():
    """Also when nobody keeps anything but the method and the memory."""
    buffered = BufferedFunction(pendulum())
    (x, u, t), (found, *_) = buffered.inputs, buffered.outputs
    evaluate = buffered.evaluate
    del buffered
    gc.collect()
    x[:], u[:], t[:] = [1.0, 2.0], 0.5, 0.0
    evaluate()
    after, _ = pendulum()([1.0, 2.0], 0.5, 0.0)
    np.testing.assert_array_equal(found, np.array(after).ravel())


def test_what_a_buffered_function_returned_stays_as_it_was():
    buffered = BufferedFunction(pendulum())
    first = buffered([1.0, 2.0], 0.5, 0.0)
    kept = [array.copy() for array in first]
    buffered([3.0, -2.0], 0.1, 1.0)
    for array, copy in zip(first, kept, strict=True):
        np.testing.assert_array_equal(array, copy)


@pytest.mark.parametrize("x", [[1.0], [[1.0, 2.0]], [1.0, 2.0, 3.0], 1.0])
def test_a_buffered_function_refuses_other_shapes(x):
    with pytest.raises(ValueError, match=r"\(2, 1\) is needed"):
        BufferedFunction(pendulum())(x, 0.0, 0.0)


@needs_compiler
def test_machine_code_that_gives_other_numbers_is_not_used(tmp_path, monkeypatch):
    """A compiler that is wrong in one derivative, as gcc 12 is with AVX-512."""
    other, function = pendulum(), pendulum()
    x, u, t = other.sx_in()
    after, cost = other.call([x, u, t])
    wrong = ca.Function("step", [x, u, t], [after, cost + 1e-3], other.name_in(), other.name_out())
    built = c_code(wrong, ("x", "u"))
    monkeypatch.setattr("ocp.codegen.compile.c_code", lambda *_: built)
    with pytest.warns(InterpretedWarning, match="step gives other numbers"):
        fast = compiled(function, along=("x", "u"), compiler=Compiler(cache=tmp_path))
    assert not fast.is_a("External")
    assert_same(declared(function, {"x", "u"}), fast, 0)
