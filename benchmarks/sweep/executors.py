"""Where the groups of a sweep are computed: threads of this machine, or a Dask cluster."""

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from queue import SimpleQueue
from uuid import uuid4

from benchmarks.sweep.error import SweepError
from benchmarks.sweep.guard import Group, run_group
from benchmarks.sweep.row import Row
from benchmarks.sweep.task import Key

Job = Callable[[Group], list[Row]]
# Rows as they come, and the end of each group.
Arrivals = SimpleQueue[Row | Future[list[Row]]]


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

    def rows(self, groups: Sequence[Group]) -> Generator[Row]:
        """Yield every row of the groups once, as soon as it is computed.

        Raises:
            SweepError: if there is no such scheduler, or no Dask, or no process can be started.
        """
        arrivals: Arrivals = SimpleQueue()
        if self.scheduler is None:
            opened = _threads(self.workers, arrivals)
        else:
            opened = _dask(self.scheduler, self.patience, arrivals)
        with opened as (executor, job):
            yield from _collected(executor, job, groups, arrivals)


def _collected(
    executor: Executor, job: Job, groups: Sequence[Group], arrivals: Arrivals
) -> Iterator[Row]:
    """Yield the rows that are told of, and at the end of a group what of it was not.

    A group whose worker died is computed again; of a row that came twice the first one counts.
    """
    waiting = [executor.submit(job, group) for group in groups]
    for future in waiting:
        future.add_done_callback(arrivals.put)
    seen: set[Key] = set()
    ended = 0
    while ended < len(waiting):
        arrived = arrivals.get()
        ended += isinstance(arrived, Future)
        for row in arrived.result() if isinstance(arrived, Future) else [arrived]:
            if row.key not in seen:
                seen.add(row.key)
                yield row


@contextmanager
def _threads(workers: int, arrivals: Arrivals) -> Iterator[tuple[Executor, Job]]:
    """A thread does nothing but wait for the process that computes."""
    pool = ThreadPoolExecutor(workers)
    try:
        yield pool, partial(run_group, tell=arrivals.put)
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _dask(address: str, patience: float, arrivals: Arrivals) -> Iterator[tuple[Executor, Job]]:
    """The same function is sent; in a worker of the cluster too, the row has its own process.

    Raises:
        SweepError: if Dask, the scheduler or its workers are not there, or go away.
    """
    try:
        from distributed import Client
        from distributed.comm.addressing import get_address_host_port
        from distributed.scheduler import KilledWorker
    except ModuleNotFoundError as missing:
        raise SweepError("Dask is not installed: pip install 'ocp-toolkit[dask]'") from missing
    try:
        # By itself a client would find out half made, and block when it is collected.
        get_address_host_port(address)
        client = Client(address, timeout=patience, set_as_default=False)
    except (OSError, ValueError) as unreachable:
        raise SweepError(f"no Dask scheduler answers at {address}") from unreachable
    with client:
        try:
            client.wait_for_workers(1, timeout=patience)
        except TimeoutError as idle:
            raise SweepError(f"the Dask scheduler at {address} has no workers") from idle
        topic = f"rows of {uuid4()}"
        client.subscribe_topic(topic, lambda event: arrivals.put(Row.parse(event[1])))
        executor = client.get_executor(pure=False)
        try:
            yield executor, partial(_telling, topic)
        except CancelledError as gone:
            raise SweepError(f"the Dask scheduler at {address} has gone") from gone
        except KilledWorker as killed:
            raise SweepError(f"Dask's workers end again and again: {killed}") from killed
        except ImportError as missing:
            raise SweepError(f"a worker cannot import the benchmarks: {missing}") from missing
        finally:
            executor.shutdown(wait=False)


def _telling(topic: str, group: Group) -> list[Row]:
    """Compute a group on a worker of Dask; its rows go ahead as events, by way of the scheduler."""
    from distributed import get_worker

    worker = get_worker()
    return run_group(group, lambda row: worker.log_event(topic, row.line()))
