"""Local workers do not hear Ctrl-C, which a terminal sends to them too, and say nothing: the command does both."""

from __future__ import annotations

import logging
import signal

from distributed import Worker, WorkerPlugin


def hush() -> None:
    """No line of Dask's own: what a person should know is said by us, once."""
    for name in [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]:
        logging.getLogger(name).setLevel(logging.CRITICAL)


class Deaf(WorkerPlugin):
    """Every worker process of a local cluster has this, also one that takes a dead one's place."""

    def setup(self, worker: Worker) -> None:  # noqa: ARG002 Dask calls it so
        hush()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
