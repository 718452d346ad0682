"""What is said of an exported loop: the head of its header, and its README."""

from solvers.direct.native.export.problem_tables import ProblemTables
from solvers.direct.native.lane_code import most_alive
from solvers.direct.native.stage_code import NOTE_BYTES, NOTED

_ALIGNMENT = 64
# Of the loop around the solver: its fixed numbers, and its arrays.
_LOOP_BYTES = 256
# Of a number in all lanes, and what the fixed part has on the stack.
_LANE_BYTES, _FIXED_STACK = 32, 4096


def header(tables: ProblemTables) -> str:
    """Return the head of the header: sizes, and what every number is."""
    lines = [
        "/* A control loop in C, made by the exporter of ocp-toolkit.",
        " *",
        *(f" * {line}" if line else " *" for line in _in_a_comment(tables)),
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


def _in_a_comment(tables: ProblemTables) -> list[str]:
    """Return problem and quantities; no name ends the comment."""
    lines = [f"Problem: {tables.loop.original.name}", "", *quantities(tables)]
    return [line.replace("*/", "* /").replace("\n", " ") for line in lines]


def quantities(tables: ProblemTables) -> list[str]:
    """Return what stands in x, u and the parameters, one line each, with units."""
    loop, m = tables.loop, tables.loop.original.model
    lines, x_units, u_units = [], m.x_units or ("",) * m.nx, m.u_units or ("",) * m.nu
    sent = m.u_names, u_units
    if loop.sends_rate:
        sent = [f"rate of {n}" for n in m.x_names], [unit and f"{unit}/s" for unit in x_units]
    for label, names, units in (("x", m.x_names, x_units), ("u", *sent)):
        each = zip(names, units, strict=True)
        lines += [
            f"{label}[{i}]  {name} {f'[{unit}]' if unit else '(unit of the model)'}"
            for i, (name, unit) in enumerate(each)
        ]
    at = 0
    for name, value in loop.parameters.items():
        what = f"{len(value)} samples of {value.shape[1]}" if value.ndim == 2 else f"{value.size}"
        lines.append(
            f"parameters[{at}] to [{at + value.size - 1}]  {name}: {what} (unit of the model)"
        )
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
        "EXPORT_NU": counts["INPUTS"],
        "EXPORT_CONTROLS": counts["USER_NU"],
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
    inputs = (1 + counts["DELAY_STEPS"]) * max(1, counts["INPUTS"]) + 1
    doubles = inputs + code.nx + counts["USER_NX"] + counts["USER_NP"] + 1
    return _whole_lines(_LOOP_BYTES + 8 * doubles) + _whole_lines(solver + _ALIGNMENT)


def stack_bytes(tables: ProblemTables) -> int:
    """Return about how much stack a call takes, where a compiler optimises."""
    functions = [*tables.loop.solve.library.code.functions, *tables.of_instant]
    return _LANE_BYTES * max(map(most_alive, functions)) + _FIXED_STACK


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


def readme(tables: ProblemTables, template: str) -> str:
    """Return the README: the template with what is known of the loop."""
    loop = tables.loop
    said = {
        "problem": loop.original.name,
        "interval": f"{loop.dt:g}",
        "horizon": f"{loop.original.duration:g}",
        "intervals": str(tables.counts["INTERVALS"]),
        "delay": f"{loop.delay:g}",
        "kilobytes": f"{workspace_bytes(tables) / 1024.0:.0f}",
        "stack": f"{stack_bytes(tables) / 1024.0:.0f}",
        "quantities": "\n".join(f"- {line}" if line else "" for line in quantities(tables)),
    }
    for word, text in said.items():
        template = template.replace(f"@{word}@", text)
    return template
