"""The workers: a local Dask cluster, or the scheduler of the lab.

Only a few chunks of tasks are submitted ahead, so memory does not grow with the fleet. The tasks of a worker that died
are repeated at the end, one at a time. This shows which task kills its worker.
"""

from __future__ import annotations

import logging
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any, TypeVar

from distributed import Worker, WorkerPlugin

from rig.errors import RigError
from rig.runs.signals import stoppable

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

AHEAD = 3  # chunks in transit for each thread of a worker
PATIENCE_S = 10  # for a scheduler to answer
FEW = 10  # messages that Dask keeps of each connection: they hold the tables that were sent, and memory would grow

NOT_STARTED = "the workers did not start ({}); free memory, or give a smaller --workers"
LOST = "the connection to the scheduler is lost; finished work is in the record: run the same command again"

T = TypeVar("T")


class FleetError(RigError):
    """The workers cannot be reached, or the connection is lost. The record has the answers so far."""

    exit_status = 3


@contextmanager
def connect_workers(scheduler: str | None, workers: int | None) -> Iterator[Client]:
    """The client of the scheduler at an address, or of a local cluster with `workers` processes.

    Raises FleetError if Dask is not installed or no scheduler answers.
    """
    try:
        import dask
        from distributed import Client
    except ImportError:
        raise FleetError("fleets need Dask; install it with: pip install 'inertial-rig[fleet]'") from None
    silence_dask()
    settings = {
        "distributed.scheduler.allowed-failures": 0,
        "distributed.comm.timeouts.connect": f"{PATIENCE_S} s",
        "distributed.worker.profile.enabled": False,
        "distributed.admin.low-level-log-length": FEW,
    }
    with dask.config.set(settings):
        if scheduler is not None:
            try:
                client = Client(scheduler, timeout=PATIENCE_S)
            except (OSError, ValueError) as error:
                raise FleetError(f"{scheduler}: no scheduler answers there ({error}); check its address") from None
            with client:
                yield client
            return
        with stoppable(), start_cluster(workers) as cluster, start_client(cluster) as client:
            yield client


def start_cluster(workers: int | None) -> LocalCluster:
    """A local cluster whose processes ignore Ctrl-C and the end of a terminal: only the command handles these.

    A cluster cannot be closed during its start, so `stoppable` lets a signal wait for the end of this function. Raises
    FleetError if a worker ends before it has started.
    """
    from distributed import LocalCluster

    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    resource_tracker.ensure_running()  # it unblocks SIGINT where it is started, which must not be a thread of Dask
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # threads of Dask and the workers inherit both
    try:
        return LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0", host="127.0.0.1")
    except RuntimeError as error:
        raise FleetError(NOT_STARTED.format(error)) from None
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGHUP})


def start_client(cluster: LocalCluster) -> Client:
    """A client of the cluster, whose workers write no messages.

    It makes a name by `uuid.getnode`, which discards any exception, so `stoppable` lets a signal wait for the end of
    this function. Raises FleetError if a worker cannot be reached.
    """
    from distributed import Client

    client = Client(cluster)
    try:
        client.register_plugin(QuietWorker())
    except OSError as error:
        client.close()
        raise FleetError(NOT_STARTED.format(error)) from None
    return client


def run_tasks(
    client: Client, work: Callable[[list[T]], Any], chunks: Iterator[list[T]]
) -> Iterator[tuple[list[T], Any]]:
    """Chunks of tasks with the results of `work`, in the order of completion; None for a task that kills its worker.

    An empty chunk is returned at once. Raises FleetError if the scheduler is lost.
    """
    from concurrent.futures import CancelledError

    from distributed import KilledWorker, as_completed

    under_way: dict[Any, list[T]] = {}
    suspects: list[T] = []
    completed = as_completed(loop=client.loop)
    try:
        queue_limit = AHEAD * max(sum(client.nthreads().values()), 1)
        while True:
            for chunk in chunks:
                if not chunk:
                    yield chunk, []
                    continue
                future = client.submit(work, chunk, pure=False)
                under_way[future] = chunk
                completed.add(future)
                if len(under_way) >= queue_limit:
                    break
            if not under_way:
                break
            future = next(completed)
            chunk = under_way.pop(future)
            try:
                yield chunk, future.result()
            except KilledWorker:
                suspects += chunk
        for task in suspects:
            try:
                yield [task], client.submit(work, [task], pure=False).result()
            except KilledWorker:
                yield [task], None
    except (CancelledError, OSError):
        raise FleetError(LOST) from None


def silence_dask() -> None:
    """Suppress the messages of Dask, because the command reports each fault once."""
    for name in [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    logging.getLogger("tornado.application").setLevel(logging.CRITICAL)  # a call of Dask that a signal ended


class QuietWorker(WorkerPlugin):
    """Plugin of every worker process of a local cluster, also of one that replaces a dead one."""

    def setup(self, worker: Worker) -> None:  # noqa: ARG002 Dask calls it so
        silence_dask()
