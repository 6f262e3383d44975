"""The workers: a local Dask cluster, or the scheduler of the lab.

Chunks of tasks are handed out a few ahead of what the workers do, so that memory does not grow with the fleet. Dask
gives the chunk of a worker that died to another. One that has killed LIVES of them is halved, until the sensor to blame
is alone.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeVar

from rig.errors import RigError

if TYPE_CHECKING:
    from distributed import Client

LIVES = 2  # workers that one chunk may kill before it is divided
AHEAD = 3  # chunks on their way for each thread of a worker
PATIENCE_S = 10  # for a scheduler to answer

T = TypeVar("T")


class FleetError(RigError):
    """The workers cannot be reached, or were lost; what was answered is in the record."""

    exit_status = 3


@contextmanager
def crew(scheduler: str | None, workers: int | None) -> Iterator[Client]:
    """The client of a scheduler at an address, or of a local cluster with so many worker processes.

    Raises FleetError where Dask is not installed, or no scheduler answers.
    """
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        raise FleetError("fleets need Dask; install it with: pip install 'inertial-rig[fleet]'") from None
    quiet = {"distributed.scheduler.allowed-failures": LIVES - 1, "distributed.logging.distributed": "critical"}
    with dask.config.set(quiet):
        if scheduler is not None:
            try:
                client = Client(scheduler, timeout=PATIENCE_S)
            except (OSError, ValueError) as error:
                raise FleetError(f"{scheduler}: no scheduler answers there ({error}); look at its address") from None
            with client:
                yield client
            return
        with (
            LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as cluster,
            Client(cluster) as client,
        ):
            yield client


def answered(
    client: Client, work: Callable[[list[T]], Any], tasks: Iterable[T], size: int
) -> Iterator[tuple[list[T], Any]]:
    """Chunks of `size` tasks with what `work` makes of them, as they are done; None for a task that kills its worker.

    Raises FleetError where the scheduler is lost, or no worker is left.
    """
    from concurrent.futures import CancelledError

    from distributed import KilledWorker, as_completed

    waiting = iter(tasks)
    again: deque[list[T]] = deque()
    under_way: dict[Any, list[T]] = {}
    done = as_completed()

    def hand_out() -> None:
        threads = max(sum(client.nthreads().values()), 1)
        while len(under_way) < AHEAD * threads:
            chunk = again.popleft() if again else list(islice(waiting, size))
            if not chunk:
                return
            future = client.submit(work, chunk, pure=False)
            under_way[future] = chunk
            done.add(future)

    hand_out()
    while under_way:
        future = next(done)
        chunk = under_way.pop(future)
        try:
            yield chunk, future.result()
        except KilledWorker:
            if len(chunk) == 1:
                yield chunk, None
            else:
                again += [chunk[: len(chunk) // 2], chunk[len(chunk) // 2 :]]
        except (CancelledError, OSError):
            raise FleetError(
                "the scheduler is lost; what is done is in the record: give the same command again"
            ) from None
        hand_out()
