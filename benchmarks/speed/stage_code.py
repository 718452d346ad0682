"""The C of an arm's stage over its links: how long it is, and how long its build takes."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from tempfile import TemporaryDirectory

import casadi as ca
from rich.table import Table

from benchmarks.speed.arm import N, arm
from ocp import OCP, RK4, Compiler, Solver
from ocp.internal import Stage, c_code, differentiable_step, stage_hessian
from solvers import MultipleShooting

_CACHE = "XDG_CACHE_HOME"
_ALONG = ("x", "u0")


@dataclass(frozen=True)
class StageCode:
    """One number of links.

    Attributes:
        links: of the arm.
        written_out: characters of C with the derivatives that CasADi writes out by itself.
        assembled: the same with those put together from one slope.
        curvature: of the function of ``StagewiseNewton``.
        build: processor time [s] of compiled fatrop with nothing in the cache, the compiler's
            included.
    """

    links: int
    written_out: int
    assembled: int
    curvature: int
    build: float

    @property
    def optimised(self) -> bool:
        """Whether the code is short enough to be optimised."""
        return self.assembled <= Compiler().optimised

    @classmethod
    def of(cls, links: int) -> "StageCode":
        """Write, build and measure."""
        ocp = arm(links)
        fatrop = MultipleShooting(N, backend="fatrop", compiled=True)
        return cls(
            links=links,
            written_out=len(c_code(_written_out(ocp), _ALONG)),
            assembled=len(c_code(differentiable_step(ocp, RK4()), _ALONG)),
            curvature=len(c_code(stage_hessian(ocp, RK4()))),
            build=_build(fatrop, ocp),
        )


def code_table(codes: Sequence[StageCode]) -> Table:
    """Return one line a number."""
    table = Table(title="arm: thousands of characters of C a stage, seconds to build")
    for column in ("over the links", *(str(code.links) for code in codes)):
        table.add_column(column, justify="left" if column[0] == "o" else "right", no_wrap=True)
    for name in ("written_out", "assembled", "curvature"):
        table.add_row(
            name.replace("_", " "), *(f"{getattr(code, name) / 1e3:.0f}" for code in codes)
        )
    table.add_row("assembled is optimised", *("yes" if code.optimised else "no" for code in codes))
    table.add_row("build of direct, fatrop [s]", *(f"{code.build:.1f}" for code in codes))
    return table


def _written_out(ocp: OCP) -> ca.Function:
    step = Stage.of(ocp, RK4(), held=True).step
    inputs = step.sx_in()
    outputs = ca.cse(list(step.call(inputs)))
    flags = {"is_diff_in": [name in _ALONG for name in step.name_in()]}
    return ca.Function("step", inputs, outputs, step.name_in(), step.name_out(), flags)


def _build(solver: Solver, ocp: OCP) -> float:
    with _empty_cache():
        before = os.times()
        solver.build(ocp)
        return sum(os.times()[:4]) - sum(before[:4])


@contextmanager
def _empty_cache() -> Iterator[None]:
    kept = os.environ.get(_CACHE)
    with TemporaryDirectory() as folder:
        os.environ[_CACHE] = folder
        try:
            yield
        finally:
            os.environ.pop(_CACHE) if kept is None else os.environ.update({_CACHE: kept})
