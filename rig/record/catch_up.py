"""After a run, the lab's record catches up where the bench file says so. A lab that is away harms no run."""

from __future__ import annotations

from collections.abc import Callable

from rig.bench import Lab
from rig.errors import RecordError
from rig.record.store import Record
from rig.record.values import Run


def push_after(record: Record, run: Run, lab: Lab | None, tell: Callable[[str], None]) -> None:
    """Push every finished run that the lab does not have, once `run` is complete; `tell` hears how it went."""
    if lab is None or not lab.push or run.state != "complete":
        return
    from rig.record.lab_url import lab_url  # a rig without a lab needs no driver
    from rig.record.push import push, unsent

    try:
        with Record(lab_url(lab.url)) as there:
            for each in unsent(record, there):
                push(record, there, each)
                tell(f"{each}: pushed to {there.where}")
    except RecordError as error:
        tell(f"not pushed: {error}")
