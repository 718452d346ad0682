"""Our own solvers beside the peers; the first one of a job is what gaps are taken against."""

from typing import Literal

from benchmarks.peers.contender import OwnContender
from benchmarks.peers.job import Job
from solvers import LinearMPC, MultipleShooting, StagewiseNewton


def own_contenders(job: Job) -> list[OwnContender]:
    """Return our solvers for a job."""
    if job.linear is not None:
        return [
            OwnContender(f"LinearMPC, {backend}", LinearMPC(backend=backend, form=form))
            for backend, form in _LINEAR
        ]
    n, tolerance = job.intervals, job.tolerance
    shooting = [
        OwnContender(
            f"MultipleShooting, {backend}{how}",
            MultipleShooting(n, backend=backend, tolerance=tolerance, compiled=not how),
            "" if how else "stages compiled",
        )
        for backend, how in _SHOOTING
    ]
    newton = StagewiseNewton(n, tolerance=tolerance, compiled=True)
    return [*shooting, OwnContender("StagewiseNewton", newton, "stages and recursion compiled")]


# Interpreted as well, as do-mpc, rockit and nmpyc are.
_SHOOTING: tuple[tuple[Literal["ipopt", "fatrop"], str], ...] = (
    ("ipopt", ""),
    ("ipopt", ", interpreted"),
    ("fatrop", ""),
)

_LINEAR: tuple[tuple[str, Literal["sparse", "condensed"]], ...] = (
    ("osqp", "sparse"),
    ("piqp", "sparse"),
    ("daqp", "condensed"),
    ("quadprog", "condensed"),
)
