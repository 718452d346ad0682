"""Functions that are no straight-line code: CasADi's own C for them, called a lane at a time."""

from collections.abc import Mapping

import casadi as ca

from ocp import UnsupportedProblem
from ocp.internal import external

# What CasADi's C is called with: pointers to arguments and values, and memory to work in.
_CALL = """static void {name}(const V *in, V *out) {{
  casadi_int numbers[{iw} + 1];
  double x[{arguments} + 1], y[{values} + 1], work[{w} + 1], *results[{res} + 1];
  const double *given[{arg} + 1];
  for (int lane = 0; lane < LANES; lane++) {{
    for (int i = 0; i < {arguments}; i++) x[i] = LANE(in[i], lane);
    {pointers}
    const int failed = own_{name}(given, results, numbers, work, 0);
    for (int i = 0; i < {values}; i++) LANE(out[i], lane) = failed ? NAN : y[i];
  }}
}}
"""


def foreign_code(functions: Mapping[str, ca.Function], problem: str) -> str:
    """Return C of Functions as lane code has it, ``static void name(const V *in, V *out)``.

    Tables and roots loop and branch, so lanes do not go together through them. A call that fails,
    such as a root that is not found, gives no number.

    Args:
        functions: by the name that they get.
        problem: whose they are, for messages.

    Raises:
        UnsupportedProblem: for functions of a library or of Python.
    """
    if not functions:
        return ""
    generator = ca.CodeGenerator("called", {"with_header": False})
    for name, function in functions.items():
        own = _renamed(function, f"own_{name}")
        if away := external(own.find_functions()):
            raise UnsupportedProblem(
                f"{problem}: the native backend has no C of '{away[0].name()}', a function of "
                "another library or of Python; write it with CasADi's operations, or take "
                "backend='ipopt'"
            )
        generator.add(own)
    return "\n".join([generator.dump(), *(_call(n, f) for n, f in functions.items())])


def _renamed(function: ca.Function, name: str) -> ca.Function:
    """Return a Function under another name: its own may be one that C knows."""
    given = [ca.MX.sym(f"x{i}", function.sparsity_in(i)) for i in range(function.n_in())]
    return ca.Function(name, given, function.call(given))


def _call(name: str, function: ca.Function) -> str:
    own = _renamed(function, f"own_{name}")
    places, lines = {"x": 0, "y": 0}, []
    for array, pointer, count, size in (
        ("x", "given", own.n_in(), own.nnz_in),
        ("y", "results", own.n_out(), own.nnz_out),
    ):
        for i in range(count):
            lines.append(f"{pointer}[{i}] = {array} + {places[array]};")
            places[array] += size(i)
    return _CALL.format(
        name=name,
        arguments=places["x"],
        values=places["y"],
        pointers=" ".join(lines),
        arg=own.sz_arg(),
        res=own.sz_res(),
        iw=own.sz_iw(),
        w=own.sz_w(),
    )
