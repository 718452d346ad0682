"""Collocation on a mesh that closes in on the instants where the control is not smooth."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ocp import Solution
from solvers.collocation.collocation import Collocation
from solvers.collocation.mesh import Mesh

# An odd number, so that a switch in the middle of an interval stays inside one: on an edge it
# is met exactly, but then constraints may depend on each other and costates are not unique.
PARTS = 3
# Of the roughest interval: what is at least this share of it is split too.
_ROUGH = 0.2
# Below this, relative to 1 + the largest control, a control is smooth.
_SMOOTH = 1e-6
# Fractions of the horizon that are not split any more.
_SHORTEST = 1e-8


def local_error(
    start: Solution, mesh: Mesh, rounds: int, solver: Collocation
) -> Iterator[Solution]:
    """Yield answers on meshes that are cut where the control is least smooth.

    A switch or a junction with an active constraint inside an interval spoils the order of
    collocation there, and leaves no error in the dynamics that would show it. Cutting such
    intervals again and again closes in on the switch, and the cost settles.

    Args:
        start: the first guess.
        mesh: the first mesh.
        rounds: answers at most; fewer where the control is smooth or a solve fails.
        solver: points and options.
    """
    answer = start
    for _ in range(rounds):
        data = answer.data
        program = replace(solver, mesh=mesh).build(answer.problem)
        answer = program.run(x0=data.x0, t0=data.t0, parameters=answer.parameters, guess=answer)
        if not answer.status.is_success:
            return
        yield answer
        rough = roughness(answer)
        split = (rough >= max(_ROUGH * rough.max(), _SMOOTH)) & (mesh.widths > _SHORTEST)
        if not split.any():
            return
        mesh = mesh.cut(PARTS, split)


def roughness(answer: Solution) -> np.ndarray:
    """Return by how much each piece of a polynomial control is no straight line, (K,).

    Second differences of its Bernstein coefficients, and the turn of its slope at both edges
    over the length of the piece, relative to 1 + the largest coefficient. A switch in the very
    middle of a piece shows in the second alone: the control runs straight from bound to bound.
    """
    if not answer.problem.model.nu:
        return np.zeros(len(answer.breaks) - 1)
    pieces = answer.u.reshape(len(answer.breaks) - 1, -1, answer.problem.model.nu)
    lengths = np.diff(answer.t[answer.breaks])[:, None]
    rises = np.diff(pieces, axis=1)
    bent = np.abs(np.diff(rises, axis=1)).max(axis=1)
    turns = np.abs(rises[1:, 0] / lengths[1:] - rises[:-1, -1] / lengths[:-1])
    bent[1:] = np.maximum(bent[1:], turns * lengths[1:])
    bent[:-1] = np.maximum(bent[:-1], turns * lengths[:-1])
    return (bent / (1.0 + np.abs(pieces).max(axis=(0, 1)))).max(axis=1)
