"""A simulated bench goes on from where an earlier run left it: the same world, its time, its warmth, its noise."""

from __future__ import annotations

from rig.connected.instruments import Rig
from rig.record import Record


def leave_as(rig: Rig, record: Record, run: str) -> None:
    """Put `rig` to where `run` ended: at rest, the oven off, the sensor face up again. A real rig is there already."""
    state = record.state(run)
    if state is None or rig.world is None:
        return
    rig.restore(state["rig"])
    rig.stop()
    if any(reading.value for reading in record.readings(run) if reading.name in ("mount", "flip")):
        rig.world.advance(max(rig.clock.now(), rig.world.now_s))
        rig.world.mount_sensor()
