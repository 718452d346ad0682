"""CasADi Functions as machine code: generated, built, kept in a cache, and loaded again."""

import os
import platform
import shlex
import shutil
import sys
import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from ocp.checks.arguments import check_instance
from ocp.checks.errors import ProblemError
from ocp.codegen.kept_library import keep_library, kept_library
from ocp.codegen.run_limited import run_limited
from ocp.expressions.foreign_functions import external
from ocp.files.draft import draft_folder

_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
# The name that the generated C gives itself; the content of a library must not depend on its file.
_UNIT = "stage"
# Vectorising straight-line code, gcc 12 makes wrong numbers of it where the processor has AVX-512:
# seen in the Jacobian of an arm's stage. Without it the code is as fast.
_FLAGS = ("-O3", "-march=native", "-fno-tree-slp-vectorize")
# By how much machine code may differ from the interpreted function, relative to 1 + abs(value):
# far more than rounding, far less than a wrong instruction.
_SAME = 1e-6
# So long a compiler may take to say its version [s].
_ANSWER = 30.0
# Inputs at which the two are compared.
_PROBES = 3


class InterpretedWarning(UserWarning):
    """A function could not be compiled: it runs interpreted, slower, with the same numbers.

    The native backend of ``MultipleShooting`` is compiled as a whole: IPOPT takes its place.
    """


class Unbuildable(Exception):
    """Why there is no machine code, in words."""


@dataclass(frozen=True)
class Compiler:
    """What turns C into machine code, and where that is kept.

    Args:
        command: as a shell would take it; None: ``$CC``, or the first of cc, gcc, clang.
        flags: its options.
        cache: folder; None: ``ocp-toolkit`` in the user's cache folder (``$XDG_CACHE_HOME``
            where it is set).
        optimised: up to so many characters of C. Beyond, a compiler would optimise for minutes,
            and ``-O0`` is added to the flags: still several times faster than interpreted.
        time_limit: of one build [s]; then the compiler is ended with all it has started.
    """

    command: str | None = None
    flags: tuple[str, ...] = _FLAGS
    cache: Path | None = None
    optimised: int = 800_000
    time_limit: float = 300.0

    @property
    def found(self) -> list[str]:
        """The command as a list; empty where there is none."""
        wanted = self.command or os.environ.get("CC", "")
        candidates = [wanted] if wanted else ["cc", "gcc", "clang"]
        with suppress(ValueError):  # a quotation without its end
            for words in map(shlex.split, candidates):
                if words and shutil.which(words[0]):
                    return words
        return []

    def words(self, code: str) -> list[str]:
        """Return command and flags for some C; empty where there is no compiler."""
        if not (command := self.found):
            return []
        return [*command, *self.flags, *(["-O0"] if len(code) > self.optimised else [])]

    @property
    def folder(self) -> Path:
        """Where the libraries are kept.

        Raises:
            FileNotFoundError: if the user has no home folder, and none is given otherwise.
        """
        return self.cache or _user_cache() / "ocp-toolkit"


def compiled(
    function: ca.Function, *, along: Sequence[str] = (), compiler: Compiler | None = None
) -> ca.Function:
    """Return a function as machine code, with the same inputs and outputs.

    The library is kept under a name made from the generated C, compiler, flags and processor,
    and from its own content: what was built once is loaded, if it still is what was built and
    nobody else could have changed it, else it is built again. It is built in a folder of its own
    and then renamed, so that two processes may build at once. What was loaded is compared with
    the interpreted function at a few inputs, since compilers make mistakes. Where it cannot be
    built in time, or kept, or gives other numbers, the interpreted function comes back, and
    ``InterpretedWarning`` says why, once per reason.

    Meant for functions of the size of one stage; map them afterwards. A whole transcribed
    problem takes minutes to compile. A function that brings its derivatives along, such as
    ``differentiable_step``, keeps them.

    Args:
        function: what to compile.
        along: names of the inputs along which first and second derivatives are generated too.
            In derivatives of the result all other inputs count as constants; with none it has
            no derivatives at all.
        compiler: default: the machine's.

    Raises:
        ProblemError: if ``along`` names no input.
    """
    check_instance(function, ca.Function, "compiled: the function")
    for name in along:
        if name not in function.name_in():
            raise ProblemError(f"compiled: {function.name()} has no input '{name}'")
    options = {}
    if along:
        options = {"is_diff_in": [name in along for name in function.name_in()]}
        # Tidied, a function that brings its derivatives along would lose them.
        if function.is_diff_in() != options["is_diff_in"]:
            function = _tidied(function, options)
    try:
        _refuse_foreign(function)
        library = built_library(c_code(function, along), compiler or Compiler())
        loaded = _loaded(function.name(), library, options)
        _compare(function, loaded, along)
        return loaded
    except Unbuildable as reason:
        announce_interpreted(str(reason))
        return function


def _refuse_foreign(function: ca.Function) -> None:
    """Raise where a function calls what is not here: its library would end the process."""
    for called in external(function.find_functions()):
        raise Unbuildable(
            f"{function.name()} calls '{called.name()}', an external function or a callback"
        )


def c_code(function: ca.Function, along: Sequence[str] = ()) -> str:
    """Return the C of a function, and of what CasADi asks for to differentiate it twice.

    Args:
        function: what to write.
        along: inputs along which it is differentiated; with none there are no derivatives.
    """
    check_instance(function, ca.Function, "c_code: the function")
    generator = ca.CodeGenerator(_UNIT)
    try:
        for each in _with_derivatives(function, along):
            generator.add(_tidied(each))
        return generator.dump()
    except RuntimeError as error:  # a node of the graph that CasADi cannot write as C
        raise Unbuildable(f"{function.name()} cannot be written as C ({error})") from error


def _with_derivatives(function: ca.Function, along: Sequence[str]) -> list[ca.Function]:
    """Return a function and, where it is differentiated, what CasADi asks it for."""
    if not along:
        return [function]
    adjoint = function.reverse(1)
    return [function, function.jacobian(), adjoint, adjoint.jacobian()]


def _compare(function: ca.Function, loaded: ca.Function, along: Sequence[str]) -> None:
    """Raise where machine code gives other numbers than the interpreted function."""
    rng = np.random.default_rng(0)
    pairs = zip(_with_derivatives(function, along), _with_derivatives(loaded, along), strict=True)
    for one, other in pairs:
        for _ in range(_PROBES):
            given = [rng.uniform(0.5, 1.5, size=one.size_in(i)) for i in range(one.n_in())]
            for right, found in zip(one.call(given), other.call(given), strict=True):
                a, b = np.array(right), np.array(found)
                known = np.isfinite(a)
                if not (np.abs(a - b) <= _SAME * (1.0 + np.abs(a)))[known].all():
                    raise Unbuildable(
                        f"the compiled {one.name()} gives other numbers than the interpreted one: "
                        "the compiler is at fault; try Compiler(flags=('-O1',))"
                    )


def _tidied(function: ca.Function, options: dict | None = None) -> ca.Function:
    """Return a function with every common subexpression computed once; about 3/4 of the code."""
    if options is None:
        options = {"is_diff_in": function.is_diff_in(), "is_diff_out": function.is_diff_out()}
    # Any: SX and MX, which the type stubs keep apart.
    is_scalar = function.is_a("SXFunction")
    inputs: Any = function.sx_in() if is_scalar else function.mx_in()
    outputs: Any = function.call(inputs, True, False)
    outputs = ca.cse(outputs) if is_scalar else outputs
    names = function.name_in(), function.name_out()
    return ca.Function(function.name(), inputs, outputs, *names, options)


def built_library(code: str, compiler: Compiler) -> Path:
    """Return the library of some C code, built unless it is there as it was built.

    Args:
        code: one translation unit, which needs the mathematical library alone.
        compiler: which one, and where its libraries are kept; see ``compiled``.

    Raises:
        Unbuildable: saying why.
    """
    words = compiler.words(code)
    if not words:
        raise Unbuildable(_no_compiler(compiler))
    version = _version(tuple(compiler.found), min(_ANSWER, compiler.time_limit))
    if version is None:
        raise Unbuildable(f"{shlex.join(compiler.found)} --version does not answer")
    key = sha256("\0".join([code, *words, version, _processor()]).encode()).hexdigest()[:32]
    try:
        folder = compiler.folder.absolute()
        folder.mkdir(0o700, parents=True, exist_ok=True)
        return kept_library(folder, key, _SUFFIX) or _build(code, words, compiler, folder / key)
    except OSError as error:
        raise Unbuildable(f"the cache cannot be written ({error})") from error


def _no_compiler(compiler: Compiler) -> str:
    wanted = compiler.command or os.environ.get("CC") or "cc"
    try:
        shlex.split(wanted)
    except ValueError as error:
        return f"the compiler '{wanted}' cannot be split into words ({error})"
    return f"there is no compiler '{wanted}'"


def _build(code: str, command: list[str], compiler: Compiler, stem: Path) -> Path:
    """Build a library in a folder of its own, and keep it when it is whole."""
    with draft_folder(stem.parent) as folder:
        source, built = folder / f"{_UNIT}.c", folder / f"{_UNIT}{_SUFFIX}"
        source.write_text(code, encoding="utf-8")
        words = [*command, "-shared", "-fPIC", str(source), "-o", str(built), "-lm"]
        try:
            end, said = run_limited(words, compiler.time_limit, folder)
        except (OSError, ValueError) as error:
            raise Unbuildable(f"{shlex.join(command)} cannot be started ({error})") from error
        if end is None:
            limit = f"{compiler.time_limit:g} s"
            raise Unbuildable(f"{shlex.join(command)} did not end within {limit}")
        if end != 0 or not built.exists():
            lines = said.strip().splitlines() or ["without a word"]
            if end < 0:
                lines = [f"it was ended by signal {-end}"]
            raise Unbuildable(f"{shlex.join(command)} failed: {lines[0][:200]}")
        return keep_library(built, stem)


def _loaded(name: str, library: Path, options: dict) -> ca.Function:
    try:
        return ca.external(name, str(library), options)
    except RuntimeError as error:  # what CasADi raises where the library cannot be opened
        raise Unbuildable(f"{library}, which was built so, cannot be loaded") from error


def _user_cache() -> Path:
    if os.environ.get("XDG_CACHE_HOME"):
        return Path(os.environ["XDG_CACHE_HOME"])
    if sys.platform == "win32" and os.environ.get("LOCALAPPDATA"):
        return Path(os.environ["LOCALAPPDATA"])
    try:
        home = Path.home()
    except RuntimeError as error:
        raise FileNotFoundError("there is no home folder: set XDG_CACHE_HOME") from error
    return home / ("Library/Caches" if sys.platform == "darwin" else ".cache")


@cache
def _version(command: tuple[str, ...], limit: float) -> str | None:
    """What a compiler says about itself; None: nothing, for so long [s]."""
    try:
        end, said = run_limited([*command, "--version"], limit)
    except (OSError, ValueError):
        return ""
    return None if end is None else said


@cache
def _processor() -> str:
    """What ``-march=native`` depends on: model and instruction sets."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        known = {line.split(":")[0].strip(): line for line in reversed(lines)}
        return "".join(known.get(key, "") for key in ("model name", "flags", "Features"))
    except OSError:
        return f"{platform.machine()} {platform.processor()}"


@cache
def announce_interpreted(reason: str) -> None:
    """Warn that there is no machine code, once per reason, whatever it was wanted for."""
    warnings.warn(
        f"no machine code: {reason}. Functions run interpreted, and IPOPT takes the place of the "
        "native backend.",
        InterpretedWarning,
        stacklevel=3,
    )
