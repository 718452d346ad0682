"""CasADi Functions as C on lanes: straight-line code, one assignment an operation."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import accumulate

import casadi as ca

from ocp import UnsupportedProblem
from solvers.direct.native.foreign_code import foreign_code

# Variables of one function, each of a lane of 32 bytes: they may all stand on the stack.
_MOST_VARIABLES = 10_000
# What C writes as an operator.
_OPERATORS = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "ALL(1.0) / {0}",
    ca.OP_LT: "NUMBER({0} < {1})",
    ca.OP_LE: "NUMBER({0} <= {1})",
    ca.OP_EQ: "NUMBER({0} == {1})",
    ca.OP_NE: "NUMBER({0} != {1})",
    ca.OP_NOT: "NUMBER({0} == ALL(0.0))",
    ca.OP_AND: "NUMBER({0} != ALL(0.0)) * NUMBER({1} != ALL(0.0))",
    ca.OP_OR: "NUMBER(NUMBER({0} != ALL(0.0)) + NUMBER({1} != ALL(0.0)) > ALL(0.0))",
    ca.OP_CONSTPOW: "lanes_pow({0}, {1})",
}
# What is a function of ``lanes.h`` of the same name.
_UNARY = "exp log sqrt sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh erf log1p expm1"
_OTHERS = "floor ceil fabs sign pow fmod remainder copysign fmin fmax atan2 hypot if_else_zero"
_OPERATORS |= {
    getattr(ca, f"OP_{name.upper()}"): f"lanes_{name}({{0}}, {{1}})"
    if name in ("pow", "fmod", "remainder", "copysign", "fmin", "fmax", "atan2", "hypot")
    or name == "if_else_zero"
    else f"lanes_{name}({{0}})"
    for name in f"{_UNARY} {_OTHERS}".split()
}


def lane_code(functions: Iterable[ca.Function], problem: str) -> str:
    """Return the C of some functions of SX, and of those that they call.

    Each becomes ``static void name(const V *in, V *out)``, with its arguments one after the other,
    and its values, column by column. What they call is named by a number: its own name may be one
    that C or the solver knows, or that of another function.

    Args:
        functions: dense ones, of different names.
        problem: whose they are, for messages.

    Raises:
        UnsupportedProblem: for an operation without C, or a call of what has none.
    """
    code = _LaneCode(problem)
    for function in functions:
        code.write(function, function.name())
    return "\n".join([foreign_code(code.foreign, problem), *code.written])


def most_alive(function: ca.Function) -> int:
    """Return how many numbers a function and what it calls have on the stack at once, at most."""
    made = [len(function.instruction_output(k)) for k in range(function.n_instructions())]
    given = [len(function.instruction_input(k)) for k in range(function.n_instructions())]
    below = [given[k] + made[k] + most_alive(each) for k, each in _calls(function).items()]
    return function.sz_w() + max(below, default=0)


@dataclass(frozen=True, eq=False)
class _LaneCode:
    """What is written so far.

    Attributes:
        problem: whose functions they are, for messages.
        called: names in C of what is called, by the hash, which is the identity: two Python objects
            of one Function are not equal.
        foreign: functions that are no SX, by their names in C.
        written: the C of the others, each after those that it calls.
    """

    problem: str
    called: dict[int, str] = field(default_factory=dict)
    foreign: dict[str, ca.Function] = field(default_factory=dict)
    written: list[str] = field(default_factory=list)

    def write(self, function: ca.Function, name: str) -> None:
        """Write a function after those that it calls, each once."""
        if not function.is_a("SXFunction"):
            self.foreign[name] = function
            return
        if function.sz_w() > _MOST_VARIABLES:
            raise UnsupportedProblem(
                f"{self.problem}: the stage is too large for the native backend, which would keep "
                f"{function.sz_w()} numbers at once on the stack (at most {_MOST_VARIABLES}); "
                "take backend='ipopt' or 'fatrop'"
            )
        for each in _calls(function).values():
            if hash(each) not in self.called:
                self.called[hash(each)] = f"called_{len(self.called)}"
                self.write(each, self.called[hash(each)])
        head = [f"static void {name}(const V *in, V *out) {{", "(void)in, (void)out;"]
        lines = [*head, *_variables(function), *_lines(function, self.called, self.problem)]
        self.written.append("\n  ".join(lines) + "\n}\n")


def _calls(function: ca.Function) -> dict[int, ca.Function]:
    """Return what is called, by the number of the instruction."""
    if ca.OP_CALL not in map(function.instruction_id, range(function.n_instructions())):
        return {}
    values = function.instructions_sx()
    return {
        k: values[k].which_function()
        for k in range(function.n_instructions())
        if function.instruction_id(k) == ca.OP_CALL
    }


def _variables(function: ca.Function) -> Iterator[str]:
    """Yield their declaration, if there are any."""
    count = function.n_instructions()
    made = {
        place
        for k in range(count)
        if function.instruction_id(k) != ca.OP_OUTPUT
        for place in function.instruction_output(k)
        if place >= 0
    }
    if made:
        yield f"V {', '.join(f'a{i}' for i in sorted(made))};"


def _lines(function: ca.Function, called: dict[int, str], problem: str) -> Iterator[str]:
    """Yield one statement an instruction."""
    calls = _calls(function)
    arguments = _begins(function.nnz_in(i) for i in range(function.n_in()))
    values = _begins(function.nnz_out(i) for i in range(function.n_out()))
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        given, made = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_INPUT:
            yield f"a{made[0]} = in[{arguments[given[0]] + given[1]}];"
        elif operation == ca.OP_OUTPUT:
            yield f"out[{values[made[0]] + made[1]}] = a{given[0]};"
        elif operation == ca.OP_CONST:
            yield f"a{made[0]} = ALL({_number(function.instruction_constant(k))});"
        elif operation == ca.OP_CALL:
            yield _call(called[hash(calls[k])], given, made)
        elif operation in _OPERATORS:
            names = [f"a{i}" for i in given]
            yield f"a{made[0]} = {_OPERATORS[operation].format(*names)};"
        else:
            raise UnsupportedProblem(
                f"{problem}: the native backend cannot write CasADi's operation number {operation} "
                "as C; write it otherwise, or take backend='ipopt'"
            )


def _call(name: str, given: list[int], made: list[int]) -> str:
    arguments = ", ".join(f"a{i}" for i in given)
    # An output that nobody uses has no place.
    kept = " ".join(f"a{i} = y[{j}];" for j, i in enumerate(made) if i >= 0)
    return f"{{ const V x[] = {{{arguments}}}; V y[{len(made)}]; {name}(x, y); {kept} }}"


def _begins(counts: Iterable[int]) -> list[int]:
    return [0, *accumulate(counts)]


def _number(value: float) -> str:
    if value != value:
        return "NAN"
    if abs(value) == float("inf"):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))
