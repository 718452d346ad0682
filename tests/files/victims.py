"""What a process does until it is killed; every number that it sends is of something written."""

from itertools import count
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from ocp import Compiler, FlightRecorder
from ocp.codegen.compile import compiled
from tests.files.examples import controller, decision, function, row, solution

FLAGS = ("-O0",)


def save(pipe: Connection, folder: Path) -> None:
    for k in count():
        solution(float(k)).save(folder / "kept.npz")
        pipe.send(k)


def record(pipe: Connection, folder: Path) -> None:
    with FlightRecorder(controller(), folder / "flight") as recorder:
        for k in count():
            recorder.watch(np.array([k, 0.5]), decision(k))
            pipe.send(k)


def append(pipe: Connection, folder: Path) -> None:
    for k in count():
        row(k).append_to(folder / "results.jsonl")
        pipe.send(k)


def build(pipe: Connection, folder: Path) -> None:
    for k in count():
        compiled(function(k), compiler=Compiler(cache=folder, flags=FLAGS))
        pipe.send(k)
