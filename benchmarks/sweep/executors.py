"""Where the groups of a sweep are waited for: threads of this machine, or a Dask cluster."""

from collections.abc import Iterator
from concurrent.futures import CancelledError, Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

from benchmarks.sweep.guard import SweepError


@dataclass(frozen=True)
class Execution:
    """How a sweep is executed.

    Attributes:
        workers: processes at a time on this machine.
        scheduler: address of a Dask scheduler, as ``tcp://host:8786``; None: this machine.
        limit: time for a row [s].
        patience: how long to wait for a scheduler, and for its first worker [s].
    """

    workers: int = 1
    scheduler: str | None = None
    limit: float = 600.0
    patience: float = 5.0

    def open(self) -> AbstractContextManager[Executor]:
        """Return the executor, for a ``with``.

        Raises:
            SweepError: (when entered) if there is no such scheduler, or no Dask.
        """
        if self.scheduler is None:
            return _threads(self.workers)
        return _dask(self.scheduler, self.patience)


@contextmanager
def _threads(workers: int) -> Iterator[Executor]:
    """A thread does nothing but wait for the process that computes."""
    pool = ThreadPoolExecutor(workers)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _dask(address: str, patience: float) -> Iterator[Executor]:
    """The same function is sent; in a worker of the cluster too, the row has its own process.

    Raises:
        SweepError: if Dask, the scheduler or its workers are not there, or go away.
    """
    try:
        from distributed import Client
        from distributed.scheduler import KilledWorker
    except ModuleNotFoundError as missing:
        raise SweepError("Dask is not installed: pip install 'ocp-toolkit[dask]'") from missing
    try:
        client = Client(address, timeout=patience, set_as_default=False)
    except (OSError, ValueError) as unreachable:
        raise SweepError(f"no Dask scheduler answers at {address}") from unreachable
    with client:
        try:
            client.wait_for_workers(1, timeout=patience)
        except TimeoutError as idle:
            raise SweepError(f"the Dask scheduler at {address} has no workers") from idle
        executor = client.get_executor(pure=False)
        try:
            yield executor
        except CancelledError as gone:
            raise SweepError(f"the Dask scheduler at {address} has gone") from gone
        except KilledWorker as killed:
            raise SweepError(f"Dask's workers end again and again: {killed}") from killed
        except ImportError as missing:
            raise SweepError(f"a worker cannot import the benchmarks: {missing}") from missing
        finally:
            executor.shutdown(wait=False)
