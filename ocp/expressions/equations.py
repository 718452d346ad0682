r"""Equations g(z, p) = 0 solved for z, as an expression in everything else.

Equations and unknowns are put into block triangular form [Pothen & Fan 1990]: blocks that are
linear in their own unknowns are solved as expressions, the others by Newton's method. The
derivatives of a root are those of the implicit function theorem, exact and of any order. Where
Newton's method finds no root, z is NaN: a point that is no root must not pass for one.
"""

from typing import NamedTuple

import casadi as ca
import numpy as np

# A root is found where no row is larger than this, relative to what its unknowns bring to it.
_ACCURACY = 1e-9
# Newton's method ends with a step that is so small, relative to the guess.
_NEWTON = {
    "abstol": 0.0,
    "abstolStep": 1e-12,
    "max_iter": 100,
    "error_on_fail": False,
    "show_eval_warnings": False,
}
# Steps in which a root is followed that is not found at once.
_STAGES = 24


class Solved(NamedTuple):
    """Equations as far as they are solved.

    Attributes:
        values: z in terms of everything else (n,), and of those of z that are not solved for.
        rows: the equations that are not solved.
        columns: the unknowns that are not solved for.
    """

    values: ca.SX
    rows: tuple[int, ...]
    columns: tuple[int, ...]


def solve_equations(g: ca.SX, z: ca.SX, start: ca.SX, *, roots: bool = True) -> Solved:
    """Solve equations that determine as many unknowns, see ``is_determined``.

    Args:
        g: what is to be zero (n,).
        z: symbols of the unknowns (n,).
        start: where a root is looked for, an expression without z (n,).
        roots: whether roots are looked for; else only what is linear is solved.
    """
    values, rows_left, columns_left = ca.SX(z), [], []
    count, rows, columns, row_ends, column_ends, *_ = ca.jacobian(g, z).sparsity().btf()
    for k in range(count):
        block = rows[row_ends[k] : row_ends[k + 1]]
        chosen = columns[column_ends[k] : column_ends[k + 1]]
        own = z[chosen]
        slopes = ca.jacobian(g[block], own)
        if not ca.depends_on(slopes, own):
            found = -ca.solve(slopes, ca.substitute(g[block], own, ca.DM.zeros(own.shape)))
        elif roots:
            found = _root(g[block], own, start[chosen])
        else:
            rows_left += block
            columns_left += chosen
            continue
        values[chosen] = ca.substitute(found, z, values)
    return Solved(values, tuple(rows_left), tuple(columns_left))


def undetermined(g: ca.SX, z: ca.SX) -> int | None:
    """Return an equation without which as many unknowns are determined, by what stands where."""
    pattern = ca.jacobian(g, z).sparsity()
    count, columns = pattern.size1(), list(range(pattern.size2()))
    rank = ca.sprank(pattern)
    if rank == count:
        return None
    for i in reversed(range(count)):
        others = [k for k in range(count) if k != i]
        if ca.sprank(pattern.sub(others, columns)[0]) == rank:
            return i
    return count - 1


def _root(g: ca.SX, z: ca.SX, start: ca.SX) -> ca.SX:
    """Return the root of g for z, an expression in all other symbols of g and start."""
    own = {e.element_hash() for e in ca.vertsplit(z)}
    given = [e for e in ca.symvar(ca.vertcat(g, start)) if e.element_hash() not in own]
    others = ca.vertcat(ca.SX(0, 1), *given)
    return _newton(z, others, g, start)(others)


def _newton(z: ca.SX, others: ca.SX, g: ca.SX, start: ca.SX) -> ca.Function:
    """(others) -> the root of g(z, others) that Newton's method finds from a start, or NaN.

    Where it does not converge at once, the root is followed from the start: of equations that the
    start solves, step by step to those that are asked for.
    """
    unit = ca.vertcat(*[_unit(e) for e in ca.vertsplit(start)])
    g, brought = (
        ca.substitute(e, z, unit * z) for e in (g, ca.fabs(ca.jacobian(g, z)) @ (ca.fabs(z) + unit))
    )
    holds = ca.Function("holds", [z, others], [ca.logic_all(ca.fabs(g) <= _ACCURACY * brought)])
    begin = ca.Function("begin", [others], [start / unit])
    left = ca.SX.sym("left")  # of what g is at the start
    partly = g - left * ca.substitute(g, z, start / unit)
    direct = ca.rootfinder("direct", "fast_newton", {"x": z, "p": others, "g": g}, _NEWTON)
    step = ca.rootfinder(
        "step", "fast_newton", {"x": z, "p": ca.vertcat(others, left), "g": partly}, _NEWTON
    )

    p, found = ca.MX.sym("p", others.numel()), ca.MX.sym("found", z.numel())
    followed = begin(p)
    for part in np.linspace(1.0, 0.0, _STAGES + 1)[1:]:
        followed = step(x0=followed, p=ca.vertcat(p, part))["x"]
    near = ca.Function.if_else(
        "near",
        ca.Function("found", [found, p], [found]),
        ca.Function("followed", [found, p], [followed]),
    )
    first = direct(x0=begin(p), p=p)["x"]
    # What a root is looked for from has no derivative.
    last = direct(x0=near(holds(first, p), first, p), p=p)["x"]
    value = unit * last + ca.if_else(holds(last, p), 0.0, np.nan)
    # As one call: what is inside is neither searched for kinks nor written out again.
    return ca.Function("root", [p], [value], {"never_inline": True})


def _unit(start: ca.SX) -> float:
    """Return what a variable is measured in while it is looked for: the size of its guess."""
    size = abs(float(start)) if start.is_constant() else 0.0
    return size if size > 0.0 and np.isfinite(size) else 1.0
