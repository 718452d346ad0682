"""``export_c``: a loop or a solver as a folder of C that needs a compiler and libm."""

import re
from hashlib import sha256
from pathlib import Path

import casadi as ca

from ocp import MPC, ProblemError, Program, Rollout, UnsupportedProblem
from ocp.internal import write_file
from solvers.direct.native.export.c_text import check_name
from solvers.direct.native.export.exported_loop import ExportedLoop
from solvers.direct.native.export.folder_texts import header, readme
from solvers.direct.native.export.problem_tables import ProblemTables
from solvers.direct.native.export.recording import Recording
from solvers.direct.native.lane_code import lane_code
from solvers.direct.native.stage_code import FILES, StageCode, read

# The loop, in the order in which the compiler reads it.
_LOOP = ("memory.h", "solve_from.h", "loop.h", "read_out.h")
_OWN = Path(__file__).with_name("c")


def export_c(
    source: MPC | Program,
    folder: str | Path,
    *,
    name: str,
    recorded: Rollout | None = None,
) -> Path:
    r"""Write a control loop as C that runs without Python; return the folder.

    The folder has the source with its header, a CMakeLists.txt, a README that says what every
    input and output is, and an example that repeats recorded steps. The C allocates nothing,
    prints nothing, keeps no state but in the caller's workspace, and names everything after
    ``name``: ``name_feedback(workspace, t, x, parameters, u)`` is one step of the loop,

    .. math:: (t, x(t), p) \mapsto u, \qquad x \in R^{n_x}, \; u \in R^{n_u},

    in the units of the user: it predicts the state over the delay, solves from the plan of the
    step before, and clips the input to its bounds. See docs/export.md.

    Args:
        source: an ``MPC`` around ``MultipleShooting(backend="native")``; or what such a solver
            builds, ``MultipleShooting(40, backend="native").build(problem)``: a loop without a
            delay, whose interval is the first one of the grid.
        folder: is made where it is missing; files of the same names are replaced.
        name: prefix of every symbol, and of the files.
        recorded: a rollout of this controller, which the example repeats; default: one of 20 steps
            on the model.

    Raises:
        ProblemError: if the name is none in C, or the rollout is none to repeat.
        UnsupportedProblem: naming what cannot be exported: another solver, a cost with kinks,
            tables and roots, data and constraints at instants, ``real_time``, signals of other
            lengths than declared.
    """
    check_name(name)
    if recorded is not None and not isinstance(recorded, Rollout):
        raise ProblemError(f"export_c: recorded is {type(recorded).__name__}, no Rollout")
    loop = ExportedLoop.of(source)
    tables, code = ProblemTables(loop), loop.solve.library.code
    functions = _functions(code, tables)
    body = [tables.code, code.sizes_code, functions, *map(read, FILES), *map(_own, _LOOP)]
    text = "\n".join(body)
    magic = f"#define MAGIC UINT64_C(0x{sha256(text.encode()).hexdigest()[:16]})"
    begin = ["/* Made by the exporter of ocp-toolkit: change the problem, not this file. */"]
    begin += ['#include "export.h"', _HEAD, '#include "export_lanes.h"', magic]
    files = {
        "export.h": header(tables) + _own("interface.h") + _HEADER_END,
        "export.c": "\n".join([*begin, text]),
        "export_lanes.h": read("lanes"),
        "export_recorded.h": Recording.of(loop, recorded).code,
        "example.c": _own("example.c"),
        "CMakeLists.txt": _own("CMakeLists.txt"),
        "README.md": readme(tables, _own("README.md")),
    }
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
        for file, content in files.items():
            write_file(target / _named(file, name), _named(content, name).encode())
    except OSError as error:
        raise ProblemError(f"export_c: {target} cannot be written: {error}") from error
    return target


# Products and sums are rounded one by one, as the recorded numbers were.
_HEAD = """
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif
#define NO_CLOCK
#define NOTED 1"""
_HEADER_END = """
#ifdef __cplusplus
}
#endif
#endif
"""


def _functions(code: StageCode, tables: ProblemTables) -> str:
    """Return the C of a stage, and of the prediction."""
    functions: list[ca.Function] = [*code.functions, *tables.of_instant]
    text = lane_code(functions, code.transcription.ocp.name)
    if "casadi_int" in text:
        raise UnsupportedProblem(
            f"export_c: {tables.loop.original.name} has a table or a root of an algebraic "
            "equation, which are not exported yet: write them as expressions"
        )
    return text


def _named(text: str, name: str) -> str:
    """Replace the prefix of the templates, and that of the solver's entries."""
    text = re.sub(r"\bnative_(?=\w+\()", f"{name}_core_", text)
    text = re.sub(r"\bexport(?=_|\.[hc]\b)", name, text)
    return re.sub(r"\bEXPORT(?=_)", name.upper(), text)


def _own(file: str) -> str:
    return (_OWN / file).read_text(encoding="utf-8")
