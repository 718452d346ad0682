"""How a peer speaks: one JSON object a line, in and out; the clock runs here, the same for all.

This file and those beside it run in the peer's own environment and import nothing of ours.
What the peer prints goes to the error stream, so that only answers are on the output. Whatever
it raises ends the process: its last words are then on the error stream.
"""

import json
import os
import sys
from collections.abc import Callable
from time import perf_counter, process_time
from typing import Any, Protocol

import numpy as np


class CannotTreat(Exception):
    """This problem is none for this peer; the text says why."""


class Peer(Protocol):
    """A job that was built.

    Attributes:
        versions: of what computes, by name.
        remark: what a reader of the table has to know.
    """

    versions: dict[str, str]
    remark: str

    def step(self, x0: np.ndarray, p: np.ndarray, guess: dict | None) -> None:
        """Do all that a controller has to do from the measured state to the first control.

        Args:
            x0: where it starts (nx,).
            p: time and parameters at the nodes (N + 1, np).
            guess: where to start, ``x`` (N + 1, nx) and ``u`` (N, nu); None: at the last answer.
        """
        ...

    def plan(self) -> dict[str, Any]:
        """Return ``x``, ``u``, ``status`` of the last step; ``t`` where the grid is its own."""
        ...


def serve(build: Callable[[dict], Peer]) -> None:
    """Answer requests until the input ends."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    peer: Peer | None = None
    for line in sys.stdin:
        request = json.loads(line)
        if request["do"] == "build":
            began = perf_counter()
            try:
                peer = build(request["job"])
                answer = {"versions": peer.versions, "remark": peer.remark}
                answer["seconds"] = perf_counter() - began
            except CannotTreat as reason:
                answer = {"cannot": str(reason)}
        else:
            assert peer is not None, "a job is built before it is solved"
            answer = _solved(peer, request)
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


def _solved(peer: Peer, request: dict) -> dict:
    x0, p, guess = np.array(request["x0"]), np.array(request["p"]), request["guess"]
    if guess is not None:
        guess = {name: np.array(rows) for name, rows in guess.items()}
    began, wall = process_time(), perf_counter()
    peer.step(x0, p, guess)
    seconds, wall = process_time() - began, perf_counter() - wall
    plan = {k: v if isinstance(v, str) else np.asarray(v).tolist() for k, v in peer.plan().items()}
    return {"seconds": seconds, "wall": wall, **plan}


def refuse_bounds_of_states(job: dict) -> None:
    """Say that there is no room for inequalities on states.

    Raises:
        CannotTreat: if the job has some.
    """
    if np.isfinite([*job["x_lower"], *job["x_upper"]]).any():
        raise CannotTreat("it has no inequalities on states")


def end_state(job: dict) -> dict[int, float]:
    """Return the states that are prescribed at the end, by index."""
    return {i: value for i, value in enumerate(job["x_end"] or []) if value is not None}


def bounds_along(job: dict) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return lower and upper bounds of (x, u) at the nodes.

    The first state is given, so that it has none; the end has no control.
    """
    along = []
    for k in range(job["N"] + 1):
        sides = []
        for side, none in (("lower", -np.inf), ("upper", np.inf)):
            x = np.array(job[f"x_{side}"]) if k > 0 else np.full(job["nx"], none)
            u = np.array(job[f"u_{side}"] if k < job["N"] else [])
            for i, value in end_state(job).items() if k == job["N"] else ():
                x[i] = value
            sides.append(np.append(x, u))
        along.append((sides[0], sides[1]))
    return along
