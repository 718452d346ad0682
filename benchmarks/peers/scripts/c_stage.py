"""The job's functions as machine code, called with arrays, for peers that take no expressions."""

import ctypes
import hashlib
import platform
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

_INTEGERS = ctypes.POINTER(ctypes.c_longlong)
_REALS = ctypes.POINTER(ctypes.c_double)
_COMPILE = ("cc", "-O3", "-march=native", "-shared", "-fPIC")


class Compiled:
    """A function of the generated C: its buffers are allocated once and used again."""

    def __init__(self, library: ctypes.CDLL, name: str) -> None:
        """Look it up, and allocate inputs and outputs."""
        self._call = getattr(library, name)
        sizes = [ctypes.c_longlong() for _ in range(4)]
        getattr(library, f"{name}_work")(*[ctypes.byref(size) for size in sizes])
        self.inputs = [self._array(library, f"{name}_sparsity_in", i) for i in range(
            self._count(library, f"{name}_n_in"))]  # fmt: skip
        self.outputs = [self._array(library, f"{name}_sparsity_out", i) for i in range(
            self._count(library, f"{name}_n_out"))]  # fmt: skip
        self._arguments = (_REALS * (int(sizes[0].value) + 1))(*self._pointers(self.inputs))
        self._results = (_REALS * (int(sizes[1].value) + 1))(*self._pointers(self.outputs))
        self._whole = (ctypes.c_longlong * (int(sizes[2].value) + 1))()
        self._work = (ctypes.c_double * (int(sizes[3].value) + 1))()

    def __call__(self, *values: np.ndarray) -> list[np.ndarray]:
        """Return the outputs, dense; they are overwritten by the next call."""
        for target, value in zip(self.inputs, values, strict=True):
            target[:, 0] = value
        self._call(self._arguments, self._results, self._whole, self._work, 0)
        return self.outputs

    @staticmethod
    def _pointers(arrays: list[np.ndarray]) -> list:
        return [array.ctypes.data_as(_REALS) for array in arrays]

    @staticmethod
    def _count(library: ctypes.CDLL, name: str) -> int:
        function = getattr(library, name)
        function.restype = ctypes.c_longlong
        return int(function())

    @staticmethod
    def _array(library: ctypes.CDLL, name: str, i: int) -> np.ndarray:
        function = getattr(library, name)
        function.restype, function.argtypes = _INTEGERS, [ctypes.c_longlong]
        sparsity = function(i)
        return np.zeros((sparsity[0], sparsity[1]), order="F")


def compiled(code: str, folder: Path | None = None) -> dict[str, Compiled]:
    """Return the functions of a job.

    Args:
        code: its source.
        folder: where the library is kept, for the next setting and the next run; None: in the
            environment of the peer.
    """
    folder = folder or Path(sys.prefix) / "compiled"
    key = " ".join([platform.node(), *_COMPILE, code])
    library = folder / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.so"
    if not library.exists():
        folder.mkdir(exist_ok=True)
        _compile(code, library)
    loaded = ctypes.CDLL(str(library.resolve()))
    names = ("stage", "stage_slopes", "stage_bend", "terminal", "terminal_slopes")
    return {name: Compiled(loaded, name) for name in names}


def _compile(code: str, library: Path) -> None:
    """Build it beside its place, since others may do the same."""
    with TemporaryDirectory(dir=library.parent) as near:
        source, new = Path(near) / "job.c", Path(near) / "job.so"
        source.write_text(code, encoding="utf-8")
        subprocess.run([*_COMPILE, str(source), "-o", str(new), "-lm"], check=True)
        new.replace(library)
