"""What stands around the C: the head of the header, the README, CMake's file."""

from solvers.direct.native.export.problem_tables import ProblemTables
from solvers.direct.native.stage_code import NOTE_BYTES, NOTED

_ALIGNMENT = 64
# Of the loop around the solver: its fixed numbers, and its arrays.
_LOOP_BYTES = 256


def header(tables: ProblemTables) -> str:
    """Return the head of the header: sizes, and what every number is."""
    lines = [
        f"/* {tables.loop.original.name}: a control loop in C, made by the exporter of ocp-toolkit.",
        " *",
        *(f" * {line}" if line else " *" for line in quantities(tables)),
        " */",
        "#ifndef EXPORT_H",
        "#define EXPORT_H",
        "",
        "#include <stddef.h>",
        "",
        "#ifdef __cplusplus",
        'extern "C" {',
        "#endif",
        "",
    ]
    lines += [f"#define {name} {value}" for name, value in _sizes(tables).items()]
    lines += _offsets(tables)
    return "\n".join([*lines, ""])


def quantities(tables: ProblemTables) -> list[str]:
    """Return what stands in x, u and the parameters, one line each, with units."""
    loop, m = tables.loop, tables.loop.original.model
    lines = []
    for label, names, units in (
        ("x", m.x_names, m.x_units or ("",) * m.nx),
        ("u", m.u_names, m.u_units or ("",) * m.nu),
    ):
        each = zip(names, units, strict=True)
        lines += [
            f"{label}[{i}]  {name} {f'[{unit}]' if unit else '(unit of the model)'}"
            for i, (name, unit) in enumerate(each)
        ]
    at = 0
    for name, value in loop.parameters.items():
        what = f"{len(value)} samples of {value.shape[1]}" if value.ndim == 2 else f"{value.size}"
        lines.append(f"parameters[{at}] to [{at + value.size - 1}]  {name}: {what} (unit of the model)")
        at += value.size
    at = 0
    for name, count in tables.constants.items():
        lines.append(f"constants[{at}] to [{at + count - 1}]  {name} (unit of the model)")
        at += count
    return [*lines, "", "Times are in seconds. A signal is sampled over the horizon, row by row."]


def _sizes(tables: ProblemTables) -> dict[str, int | str]:
    counts = tables.counts
    return {
        "EXPORT_NX": counts["USER_NX"],
        "EXPORT_NU": counts["USER_NU"],
        "EXPORT_NP": counts["USER_NP"],
        "EXPORT_N": counts["INTERVALS"],
        "EXPORT_CONSTANTS": sum(tables.constants.values()),
        "EXPORT_ALIGNMENT": _ALIGNMENT,
        "EXPORT_WORKSPACE_BYTES": workspace_bytes(tables),
    }


def workspace_bytes(tables: ProblemTables) -> int:
    """Return bytes that suffice: those of the solver with pointers of 8 bytes and 4 lanes."""
    counts, code = tables.counts, tables.loop.solve.library.code
    solver = tables.loop.solve.library.bytes - (NOTED - 1) * NOTE_BYTES
    inputs = (1 + counts["DELAY_STEPS"]) * max(1, counts["USER_NU"]) + 1
    doubles = inputs + code.nx + counts["USER_NX"] + counts["USER_NP"] + 1
    return _whole_lines(_LOOP_BYTES + 8 * doubles) + _whole_lines(solver + _ALIGNMENT)


def _whole_lines(count: int) -> int:
    return -(-count // _ALIGNMENT) * _ALIGNMENT


def _offsets(tables: ProblemTables) -> list[str]:
    """Where each parameter begins, as macros."""
    lines, at = [], 0
    for name, value in tables.loop.parameters.items():
        word = "".join(c if c.isascii() and c.isalnum() else "_" for c in name).upper()
        lines.append(f"#define EXPORT_AT_{word} {at}")
        at += value.size
    return lines


def cmake() -> str:
    """Return CMake's file."""
    return """cmake_minimum_required(VERSION 3.13)
project(export C)
set(CMAKE_C_STANDARD 11)
set(CMAKE_C_EXTENSIONS OFF)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

add_library(export_loop STATIC export.c)
target_include_directories(export_loop PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
if(NOT MSVC)
  target_compile_options(export_loop PRIVATE -Wall -Wextra)
  target_link_libraries(export_loop PUBLIC m)
endif()

add_executable(export_example example.c)
target_link_libraries(export_example export_loop)

enable_testing()
add_test(NAME recorded COMMAND export_example)
"""


def readme(tables: ProblemTables) -> str:
    """Return the README."""
    loop, counts = tables.loop, tables.counts
    listed = "\n".join(f"- {line}" if line else "" for line in quantities(tables))
    kilobytes = workspace_bytes(tables) / 1024.0
    return f"""# export: {loop.original.name}

A control loop in C11. It needs a C compiler and libm. It allocates nothing, prints nothing, and keeps no
state but in memory that you give it.

| file | what it is |
|---|---|
| `export.h` | the functions that you call |
| `export.c`, `export_lanes.h` | the solver |
| `example.c`, `export_recorded.h` | repeats steps that were recorded in Python, and compares |
| `CMakeLists.txt` | builds a library, and the example as a test |

Without CMake: `cc -std=c11 -O2 export.c example.c -lm -o example && ./example`

## Use

```c
#include "export.h"

static _Alignas(EXPORT_ALIGNMENT) unsigned char workspace[EXPORT_WORKSPACE_BYTES]; /* {kilobytes:.0f} kB */

double x[EXPORT_NX], parameters[EXPORT_NP + 1], u[EXPORT_NU];
export_init(workspace, sizeof workspace);     /* once */
export_declared(x, parameters);               /* the numbers of the problem, to begin with */

/* every {loop.dt:g} s: */
export_status status = export_feedback(workspace, t, x, parameters, u);
```

Look at `status` at every step. `EXPORT_SOLVED`: u is the input of a new plan. `EXPORT_SHIFTED`: the solve has
failed, u is what the plan before says for this time. `EXPORT_NO_PLAN` and everything from 16 on: **u was not
written**, your own fallback has to act. `export_last_report` says how the solve has ended.

`export_follow` gives the input of the plan that is kept where there is no measurement.

## What goes in and comes out

{listed}

- The horizon is {loop.original.duration:g} s in {counts["INTERVALS"]} intervals, the sampling interval {loop.dt:g} s.
- The delay from measurement to effect is {loop.delay:g} s; the inputs that are on their way are kept in the workspace.
- Every array is of `double`. NaN and infinity in time, state or parameters are refused by a return code.

## What it does not do

- There is no clock in it: `max_iterations` of the solver bounds the time of a step.
- After a failure it does not check that the plan before still meets the constraints, as Python does, and there is no
  backup law.
- Only the bounds of the inputs are imposed on what it returns; constraints hold as the plan meets them.
- One workspace is for one thread at a time; several workspaces may be used at once.
- On another processor, or with another compiler, the numbers differ by rounding.
"""
