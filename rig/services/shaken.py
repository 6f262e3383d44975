"""What a run of the procedure motion shows beside the model that a report is on."""

from __future__ import annotations

from pathlib import Path

from calibrations.motion.evaluate import MotionResult
from rig.record import Record
from rig.record.measured import Measured
from rig.results.motion import beside_displacement


def shaken_of(data: str) -> MotionResult | None:
    """Both models beside the displacement sensor; None where `data` is a file, or a run of something else.

    Raises SensorFault, RecordError, DataError.
    """
    if Path(data).exists():
        return None
    with Record.to_find(data) as record:
        measured = Measured.named(record, data)
        return beside_displacement(measured) if measured.run.procedure == "motion" else None
